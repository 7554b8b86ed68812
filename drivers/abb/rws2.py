"""Robot Web Services 2.0 of an OmniCore controller (RobotWare 7).

Source: ABB, "Robot Web Services 2.0" (3HAC073675-001), and what users found where a controller does
otherwise (RobotWare 7.21): HTTPS, Basic login, HAL documents, actions as paths in the place of
``?action=``, versioned media types, and mastership of the domain ``edit`` for data and program
pointer. What it offers has the names and shapes of `abb_robot_client.rws.RWS`, which speaks 1.0, so
that everything above takes either.
"""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np

from drivers.abb.login import Login

_HEADERS = {
    "Accept": "application/hal+json;v=2.0",
    "Content-Type": "application/x-www-form-urlencoded;v=2.0",
}
_BYTES = {"Content-Type": "application/octet-stream;v=2.0"}
_UNITS = "rw/motionsystem/mechunits"
_REFUSED = 300
_NO_CONTENT = 204


class Rws2Refused(Exception):
    """The controller refused.

    Attributes
    ----------
    code:
        Its return code; the HTTP status where it states none, -1 for a login that was refused.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class Rws2:
    """One session.

    Parameters
    ----------
    url:
        Such as ``https://192.168.125.1:443``.
    session:
        A `requests.Session` whose requests are bounded.
    login:
        User name and password; they go over the wire as they are, which is why it is HTTPS.
    """

    def __init__(self, url: str, session: Any, login: Login) -> None:
        self._url, self._session = url, session
        session.auth = (login.user, login.password)
        self._edits = False

    @property
    def cookie(self) -> str:
        """What names the session to the controller."""
        return "; ".join(f"{cookie.name}={cookie.value}" for cookie in self._session.cookies)

    # ---- panel and execution -----------------------------------------------------------------

    def get_operation_mode(self) -> str:
        """``AUTO``, ``MANR`` or ``MANF``."""
        return str(self._first("rw/panel/opmode")["opmode"])

    def get_controller_state(self) -> str:
        """``motoron``, ``motoroff``, ``guardstop``, ..."""
        return str(self._first("rw/panel/ctrl-state")["ctrlstate"])

    def get_execution_state(self) -> Any:
        """Whether RAPID runs, as `RAPIDExecutionState`."""
        from abb_robot_client.rws import RAPIDExecutionState

        reported = self._first("rw/rapid/execution")
        return RAPIDExecutionState(reported["ctrlexecstate"], reported.get("cycle", "asis"))

    def resetpp(self) -> None:
        """Move the program pointers to main."""
        self._edit("rw/rapid/execution/resetpp", {})

    def start(self, cycle: str = "asis", tasks: list[str] | None = None) -> None:
        """Start RAPID; which tasks run is chosen on the controller."""
        self._post(
            "rw/rapid/execution/start",
            {
                "regain": "continue",
                "execmode": "continue",
                "cycle": cycle,
                "condition": "none",
                "stopatbp": "disabled",
                "alltaskbytsp": "true",
            },
        )

    # ---- where the arm is --------------------------------------------------------------------

    def get_jointtarget(self, mechunit: str = "ROB_1") -> Any:
        """Joints, degrees, as `JointTarget`."""
        from abb_robot_client.rws import JointTarget

        reported = self._first(f"{_UNITS}/{mechunit}/jointtarget")
        return JointTarget(
            _numbers(reported, [f"rax_{i}" for i in range(1, 7)]),
            _numbers(reported, [f"eax_{letter}" for letter in "abcdef"]),
        )

    def get_robtarget(
        self,
        mechunit: str = "ROB_1",
        tool: str = "tool0",
        wobj: str = "wobj0",
        coordinate: str = "Base",
    ) -> Any:
        """Pose of a tool, millimetres and quaternion, as `RobTarget`."""
        from abb_robot_client.rws import RobTarget

        query = f"tool={tool}&wobj={wobj}&coordinate={coordinate}"
        reported = self._first(f"{_UNITS}/{mechunit}/robtarget?{query}")
        return RobTarget(
            _numbers(reported, list("xyz")),
            _numbers(reported, [f"q{i}" for i in range(1, 5)]),
            _numbers(reported, ["cf1", "cf4", "cf6", "cfx"]),
            _numbers(reported, [f"eax{letter}" for letter in "abcdef"]),
        )

    # ---- data, files, log --------------------------------------------------------------------

    def get_rapid_variable(self, var: str, task: str = "T_ROB1") -> str:
        """Value of a persistent variable, named ``module/name``."""
        return str(self._first(f"rw/rapid/symbol/RAPID/{task}/{var}/data")["value"])

    def set_rapid_variable(self, var: str, value: str, task: str = "T_ROB1") -> None:
        """Set a persistent variable, named ``module/name``."""
        self._edit(f"rw/rapid/symbol/RAPID/{task}/{var}/data", {"value": value})

    def get_ramdisk_path(self) -> str:
        """The RAM disk's volume in the file service."""
        return "RAMDISK"

    def upload_file(self, filename: str, contents: bytes) -> None:
        """Write a file."""
        self._ask("PUT", f"fileservice/{filename}", data=contents, headers={**_HEADERS, **_BYTES})

    def read_event_log(self, elog: int = 0) -> list[Any]:
        """Entries, newest first, as `EventLogEntry`."""
        from abb_robot_client.rws import EventLogEntry

        return [
            EventLogEntry(
                int(str(reported["_title"]).rpartition("/")[2]),
                int(reported["msgtype"]),
                int(reported["code"]),
                None,
                [str(argument["value"]) for argument in reported.get("argv", [])],
                *(str(reported.get(key, "")) for key in ("title", "desc", "conseqs", "causes")),
                str(reported.get("actions", "")),
            )
            for reported in self._states(f"rw/elog/{elog}?lang=en")
        ]

    def close(self) -> None:
        """Give mastership back and end the session."""
        if self._edits:
            self._edits = False
            with contextlib.suppress(OSError, Rws2Refused):
                self._post("rw/mastership/edit/release", {})
        with contextlib.suppress(OSError, Rws2Refused):
            self._states("logout")
        self._session.close()

    # ---- requests ----------------------------------------------------------------------------

    def _edit(self, path: str, payload: dict[str, str]) -> None:
        """Write what needs mastership; it is kept, to ask for it each time would be too much."""
        if not self._edits:
            self._post("rw/mastership/edit/request", {})
            self._edits = True
        try:
            self._post(path, payload)
        except Rws2Refused:
            self._edits = False  # it may have been taken away: asked for again with the next
            raise

    def _first(self, path: str) -> dict[str, Any]:
        states = self._states(path)
        if not states:
            raise Rws2Refused(f"/{path} reports nothing", 0)
        return states[0]

    def _states(self, path: str) -> list[dict[str, Any]]:
        reported = self._ask("GET", path, headers=_HEADERS)
        embedded = reported.get("_embedded")
        listed = embedded.get("resources") if isinstance(embedded, dict) else None
        found = reported.get("state") or listed
        return [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []

    def _post(self, path: str, payload: dict[str, str]) -> None:
        self._ask("POST", path, data=payload, headers=_HEADERS)

    def _ask(self, method: str, path: str, **more: Any) -> dict[str, Any]:
        answer = self._session.request(method, f"{self._url}/{path}", **more)
        reported = {} if answer.status_code == _NO_CONTENT or not answer.content else _json(answer)
        if answer.status_code >= _REFUSED:
            status = reported.get("status")
            fields = status if isinstance(status, dict) else {}
            code = -1 if answer.status_code == 401 else int(fields.get("code", answer.status_code))
            raise Rws2Refused(str(fields.get("msg", f"HTTP status {answer.status_code}")), code)
        return reported


def _json(answer: Any) -> dict[str, Any]:
    try:
        reported = answer.json()
    except ValueError:
        reported = None
    return reported if isinstance(reported, dict) else {}


def _numbers(reported: dict[str, Any], names: list[str]) -> Any:
    return np.array([reported[name] for name in names], dtype=np.float64)
