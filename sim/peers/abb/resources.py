"""What each RWS resource of the controller answers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol
from urllib.parse import parse_qs

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.units import millimetres, scalar_first
from drivers.arm import ArmState
from sim.peers.abb.cell_watch import CellWatch
from sim.peers.abb.event_log import EventLog
from sim.peers.abb.panel import ABBFaults, PanelState
from sim.peers.controller_faults import StopOrders

_UNUSED_AXIS = "9E+09"
_FILES = "fileservice/"
_RAMDISK = "RAMDISK"
_WATCH = "rw/rapid/symbol/data/RAPID/T_CELL_WATCH/cell_watch/cell_watch_"


@dataclass(frozen=True)
class Answer:
    """Status and body of an HTTP answer; bytes are sent as they are, the rest as JSON."""

    status: int
    body: Any = b""
    kind: str | None = None
    """Content type, where it does not follow from the body."""
    headers: tuple[tuple[str, str], ...] = ()


def state(*entries: dict[str, Any]) -> Answer:
    """Return an answer with RWS's envelope."""
    return Answer(200, {"_links": {}, "_embedded": {"_state": list(entries)}})


def error(status: int, code: int, message: str) -> Answer:
    """Return an answer that refuses."""
    return Answer(status, {"_embedded": {"status": {"code": code, "msg": message}}})


_NOT_ALLOWED = error(403, -1073442809, "operation not allowed in this controller state")


class Controller(Protocol):
    """What the resources tell of their controller, and what they order."""

    running: bool
    panel: PanelState
    faults: ABBFaults
    files: dict[str, bytes]
    log: EventLog
    watch: CellWatch
    request_times_s: list[float]
    world_from_base: RigidTransform
    flange_from_active_tool: RigidTransform

    @property
    def stop_orders(self) -> StopOrders:
        """How orders to stop are taken."""

    @property
    def reported(self) -> Callable[[], ArmState]:
        """Returns the arm's state as the controller reports it."""

    def note(self, what: str) -> None:
        """Remember that something arrived."""

    def start(self) -> None:
        """Start RAPID at the program pointer."""

    def stop(self, why: str) -> None:
        """Stop RAPID and the arm."""


class Resources:
    """Answers requests for one controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        units = "rw/motionsystem/mechunits/ROB_1"
        self._robtarget_path = f"{units}/robtarget"
        self._gets: dict[str, Callable[[], Answer]] = {
            "rw/system": lambda: state({"_type": "sys-system", "rwversion": "6.14.00.01"}),
            "rw/panel/ctrlstate": lambda: state({"ctrlstate": controller.panel.controller}),
            "rw/panel/opmode": lambda: state({"opmode": controller.panel.mode}),
            "rw/rapid/execution": self._execution,
            "rw/rapid/tasks": self._tasks,
            "rw/elog/0": lambda: state(*controller.log.entries()),
            "ctrl/$RAMDISK": lambda: state({"_type": "ctrl-env", "_value": _RAMDISK}),
            f"{units}/jointtarget": self._jointtarget,
        }
        self._posts: dict[tuple[str, str], Callable[[], Answer]] = {
            ("rw/rapid/execution", "start"): self._start,
            ("rw/rapid/execution", "stop"): self._stop,
            ("rw/rapid/execution", "resetpp"): lambda: Answer(204),
            ("rw/rapid/tasks/T_ROB1", "activate"): lambda: Answer(204),
            ("rw/panel/ctrlstate", "setctrlstate"): self._motors_off,
        }

    def faults(self) -> ABBFaults:
        """What goes wrong with the controller at present."""
        return self._controller.faults

    def answer(self, method: str, path: str, query: dict[str, str], body: bytes) -> Answer:
        """Return what a request gets."""
        self._controller.request_times_s.append(time.monotonic())
        if path.startswith(_FILES):
            return self._file(method, path.removeprefix(_FILES), body)
        if path.startswith(_WATCH) and self._controller.watch.loaded:
            return self._watched(method, path.removeprefix(_WATCH), body)
        if method == "GET" and path == self._robtarget_path:
            return self._robtarget(query)
        if method == "GET" and path in self._gets:
            return self._gets[path]()
        action = (path, query.get("action", ""))
        if method == "POST" and action in self._posts:
            return self._posts[action]()
        return error(404, -1073445865, f"no such resource: {path}")

    def _execution(self) -> Answer:
        running = "running" if self._controller.running else "stopped"
        return state({"_type": "rap-execution", "ctrlexecstate": running, "cycle": "once"})

    def _tasks(self) -> Answer:
        return state(
            {
                "_type": "rap-task-li",
                "name": "T_ROB1",
                "type": "normal",
                "taskstate": "linked",
                "excstate": "ready",
                "active": "On",
                "motiontask": "TRUE",
            }
        )

    def _jointtarget(self) -> Answer:
        joints = np.degrees(self._controller.reported().joints_rad or ())
        entry = {f"rax_{i}": f"{angle:.6f}" for i, angle in enumerate(joints, 1)}
        entry |= {f"eax_{letter}": _UNUSED_AXIS for letter in "abcdef"}
        return state({"_type": "ms-jointtarget", **entry})

    def _robtarget(self, query: dict[str, str]) -> Answer:
        pose = self._controller.reported().base_from_flange
        if query.get("coordinate") != "Base":
            pose = self._controller.world_from_base * pose
        if query.get("tool") != "tool0":
            pose = pose * self._controller.flange_from_active_tool
        entry = dict(zip("xyz", (f"{v:.5f}" for v in millimetres(pose)), strict=True))
        entry |= {f"q{i}": f"{v:.9f}" for i, v in enumerate(scalar_first(pose), 1)}
        entry |= {"cf1": "0", "cf4": "0", "cf6": "0", "cfx": "0"}
        entry |= {f"eax{letter}": _UNUSED_AXIS for letter in "abcdef"}
        return state({"_type": "ms-robtargets", **entry})

    def _start(self) -> Answer:
        controller = self._controller
        controller.note("rws: start")
        if controller.panel.mode != "AUTO" or controller.panel.controller != "motoron":
            return _NOT_ALLOWED
        if controller.running:
            return error(403, -1073442812, "RAPID is executing")
        controller.start()
        return Answer(204)

    def _stop(self) -> Answer:
        self._controller.note("rws: stop")
        if self._controller.stop_orders.refused or self._controller.faults.rapid_stop_refused:
            return _NOT_ALLOWED
        self._controller.stop("rws stop")
        return Answer(204)

    def _motors_off(self) -> Answer:
        self._controller.note("rws: motors off")
        if self._controller.stop_orders.refused:
            return _NOT_ALLOWED
        self._controller.panel.controller = "motoroff"
        self._controller.stop("motors off")
        return Answer(204)

    def _watched(self, method: str, name: str, body: bytes) -> Answer:
        values = self._controller.watch.values
        if method == "GET":
            return state({"_type": "rap-data", "value": f"{values[name]:g}"})
        values[name] = float(parse_qs(body.decode())["value"][0])
        return Answer(204)

    def _file(self, method: str, name: str, body: bytes) -> Answer:
        files = self._controller.files
        if method == "PUT":
            files[name] = body
            return Answer(201)
        if name not in files:
            return error(404, -1073414146, f"no such file: {name}")
        if method == "DELETE":
            del files[name]
            return Answer(204)
        return Answer(200, files[name])
