"""Robot Web Services 2.0: the resources of an OmniCore that clients use to move its arm.

Source: ABB, "Robot Web Services 2.0" (3HAC073675-001), and bodies that users recorded of RobotWare
7.21: a HAL document with ``state`` or ``_embedded.resources``, actions as paths, mastership of the
domain ``edit`` for data and program pointers.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qs

from sim.peers.abb.answers import DONE, Answer
from sim.peers.abb.arm_resources import UNIT, ArmResources, Controller, Envelope
from sim.peers.abb.panel import ABBFaults

_FILES, _SYMBOL, _MASTERSHIP = "fileservice/", "rw/rapid/symbol/RAPID/", "rw/mastership/"
_WATCH = "T_CELL_WATCH/cell_watch/cell_watch_"
_FORM, _HAL = "application/x-www-form-urlencoded;v=2.0", "application/hal+json;v=2.0"
_SUCCESS = 294912


def state(*entries: dict[str, Any]) -> Answer:
    """Return an answer with the resource's states."""
    links = {"base": {"href": "https://localhost/"}, "self": {"href": ""}}
    body = {"_links": links, "status": {"code": _SUCCESS}, "state": list(entries)}
    return Answer(200, body, _HAL)


def resources(*entries: dict[str, Any]) -> Answer:
    """Return an answer with a list of resources."""
    links = {"base": {"href": "https://localhost/"}}
    embedded = {"resources": list(entries)}
    body = {"_links": links, "status": {"code": _SUCCESS}, "_embedded": embedded}
    return Answer(200, body, _HAL)


def error(status: int, code: int, message: str) -> Answer:
    """Return an answer that refuses."""
    return Answer(status, {"status": {"code": code, "msg": message}}, _HAL)


_NOT_ALLOWED = error(403, -1073442809, "Operation not allowed in this controller state")
_NO_MASTERSHIP = error(403, -1073445859, "User does not have required mastership")
_HELD = error(403, -1073445857, "Mastership is held by another client")


class Resources2:
    """Answers requests for one controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        arm = self._arm = ArmResources(controller, Envelope(state, error, _NOT_ALLOWED))
        self._master: str | None = None
        self._gets: dict[str, Callable[[], Answer]] = {
            "rw/system": lambda: state({"_type": "sys-system", "rwversion": "7.21.0"}),
            "rw/panel/ctrl-state": lambda: state(
                {"_type": "pnl-ctrlstate", "ctrlstate": controller.panel.controller}
            ),
            "rw/panel/opmode": lambda: state(
                {"_type": "pnl-opmode", "opmode": controller.panel.mode}
            ),
            "rw/rapid/execution": arm.execution,
            "rw/elog/0": self._log,
            f"{UNIT}/jointtarget": arm.jointtarget,
            "logout": lambda: DONE,
        }
        self._posts: dict[str, Callable[[dict[str, str]], Answer]] = {
            "rw/rapid/execution/start": lambda _: arm.start(),
            "rw/rapid/execution/stop": lambda _: arm.stop(),
            "rw/panel/ctrl-state": self._set_state,
        }
        self._edits: dict[str, Callable[[dict[str, str]], Answer]] = {
            "rw/rapid/execution/resetpp": lambda _: DONE,
        }

    def faults(self) -> ABBFaults:
        """What goes wrong with the controller at present."""
        return self._controller.faults

    def answer(
        self, method: str, path: str, query: dict[str, str], body: bytes, client: str, kind: str
    ) -> Answer:
        """Return what a request gets; `client` names who is logged in, `kind` the body's type."""
        self._controller.request_times_s.append(time.monotonic())
        if path.startswith(_FILES):
            return self._file(method, path.removeprefix(_FILES), body)
        if method == "GET":
            return self._get(path, query)
        if kind != _FORM:
            return error(415, -1, "Unsupported media type")
        values = {key: given[0] for key, given in parse_qs(body.decode(errors="replace")).items()}
        if path.startswith(_MASTERSHIP):
            return self._mastership(path.removeprefix(_MASTERSHIP), client)
        if path in self._posts:
            return self._posts[path](values)
        return self._edit(path, values, client)

    def _get(self, path: str, query: dict[str, str]) -> Answer:
        if path == f"{UNIT}/robtarget":
            return self._arm.robtarget(query)
        if path.startswith(_SYMBOL):
            value = self._data(path)
            if value is not None:
                return state({"_type": "rap-data", "value": value})
        answer = self._gets.get(path)
        return answer() if answer else error(404, -1073445865, "No such resource")

    def _edit(self, path: str, values: dict[str, str], client: str) -> Answer:
        """What needs the mastership of the domain edit."""
        known = path in self._edits or (path.startswith(_SYMBOL) and self._data(path) is not None)
        if not known:
            return error(404, -1073445865, "No such resource")
        if self._master != client:
            return _NO_MASTERSHIP
        if path in self._edits:
            return self._edits[path](values)
        return self._set_data(path, values["value"])

    def _mastership(self, path: str, client: str) -> Answer:
        domain, _, action = path.rpartition("/")
        if domain != "edit" or action not in ("request", "release"):
            return error(404, -1073445865, "No such resource")
        if self._master not in (None, client):
            return _HELD
        self._master = client if action == "request" else None
        return DONE

    def _data(self, path: str) -> str | None:
        name = path.removeprefix(_SYMBOL).removesuffix("/data")
        watch = self._controller.watch
        if name.startswith(_WATCH) and watch.loaded:
            value = watch.values.get(name.removeprefix(_WATCH))
            return None if value is None else f"{value:g}"
        return self._controller.rapid_data.get(name)

    def _set_data(self, path: str, value: str) -> Answer:
        name = path.removeprefix(_SYMBOL).removesuffix("/data")
        if name.startswith(_WATCH):
            self._controller.watch.values[name.removeprefix(_WATCH)] = float(value)
        else:
            self._controller.rapid_data[name] = value
        return DONE

    def _log(self) -> Answer:
        return resources(*self._controller.log.entries())

    def _set_state(self, values: dict[str, str]) -> Answer:
        return self._arm.motors_off(understood=values.get("ctrl-state") == "motoroff")

    def _file(self, method: str, name: str, body: bytes) -> Answer:
        files = self._controller.files
        if method == "PUT":
            files[name] = body
            return Answer(201, b"")
        if name not in files:
            return error(404, -1073414146, "No such file")
        if method == "DELETE":
            del files[name]
            return DONE
        return Answer(200, files[name])
