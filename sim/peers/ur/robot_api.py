"""The robot API of a controller with PolyScope X: HTTP and JSON in place of the dashboard server.

Source: Universal Robots, "Robot API", OpenAPI document of versions 3.1 (PolyScope X 10.12) and 5.0
(10.14): domains robotstate, program, system, versions and popup. Orders are answered with 403 in
local mode and 409 where the present state does not allow them.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler
from typing import Any

from sim.peers.controller_faults import ControllerFaults
from sim.peers.http import DroppableServer
from sim.peers.ur.modes import Robot, Safety
from sim.peers.ur.panel_controller import PanelController

BASE = "/universal-robots/robot-api"
_POLL_S = 0.02
_SAFETY_NAMES = {
    Safety.NORMAL: "NORMAL",
    Safety.PROTECTIVE_STOP: "PROTECTIVE_STOP",
    Safety.EMERGENCY_STOP: "EMERGENCY_STOP",
}
_FORBIDDEN = (
    403,
    {
        "message": "Forbidden - Operation Not Allowed",
        "details": "The robot must be in remote mode to perform this operation.",
    },
)
_LATER = "5.0.107"

Reply = tuple[int, dict[str, Any]]


class RobotApiServer:
    """Serves the robot API of one controller.

    Parameters
    ----------
    address:
        Host and port.
    controller:
        Whose.
    api_version:
        Below 5.0 it knows neither versions nor model nor popups.
    """

    def __init__(
        self, address: tuple[str, int], controller: PanelController, api_version: str
    ) -> None:
        api = _Api(controller, api_version)
        handler = type("Handler", (_Handler,), {"api": api})
        self._server = DroppableServer(address, handler)
        threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True
        ).start()

    def drop(self) -> None:
        """Close every connection."""
        self._server.drop()

    def close(self) -> None:
        """Close the port and every connection."""
        self._server.end()


class _Api:
    def __init__(self, controller: PanelController, api_version: str) -> None:
        self._controller = controller
        self._version = api_version
        answers: dict[str, Callable[[], dict[str, Any]]] = {
            "/openapi.json": lambda: {
                "openapi": "3.1.0",
                "info": {"title": "Robot API", "version": api_version},
            },
            "/robotstate/v1/robotmode": lambda: {"mode": controller.robot_mode.name},
            "/robotstate/v1/safetymode": lambda: {"mode": _SAFETY_NAMES[controller.safety]},
            "/program/v1/state": lambda: {"state": controller.runtime.name, "message": ""},
            "/system/v1/controlmode": lambda: {
                "mode": "REMOTE" if controller.remote_control else "LOCAL"
            },
            "/system/v1/operationalmode": lambda: {"mode": "AUTOMATIC"},
        }
        later: dict[str, Callable[[], dict[str, Any]]] = {
            "/versions/v1": lambda: {"marketingVersion": "{}.{}.{}".format(*controller.version)},
            "/system/v1/information": lambda: {
                "robotType": controller.model,
                "serialNumber": "20255500001",
            },
        }
        self._answers = answers | (later if self._knows_later() else {})
        self._states: dict[str, Callable[[], Reply]] = {
            "POWER_ON": lambda: self._power(Robot.IDLE),
            "POWER_OFF": lambda: self._power(Robot.POWER_OFF),
            "BRAKE_RELEASE": lambda: self._power(Robot.RUNNING),
            "UNLOCK_PROTECTIVE_STOP": self._unlock,
            "RESTART_SAFETY": lambda: (200, {"message": "Safety restarted"}),
        }
        self._programs: dict[str, Callable[[], Reply]] = {
            "stop": self._stop,
            "play": lambda: self._done(controller.play(), "play"),
            "resume": lambda: self._done(controller.play(), "resume"),
            "pause": lambda: self._done(controller.pause(), "pause"),
        }

    def faults(self) -> ControllerFaults:
        return self._controller.faults

    def answer(self, verb: str, path: str, body: bytes) -> Reply:
        if verb == "GET":
            answer = self._answers.get(path)
            return (200, answer()) if answer else _missing(path)
        orders = {"/robotstate/v1/state": self._states, "/program/v1/state": self._programs}
        if verb == "DELETE" and path.startswith("/popup/v1") and self._knows_later():
            return 200, {"message": "Popup closed"}
        if verb != "PUT" or path not in orders:
            return _missing(path)
        if not self._controller.remote_control:
            return _FORBIDDEN
        return self._order(orders[path], body)

    def _order(self, known: dict[str, Callable[[], Reply]], body: bytes) -> Reply:
        try:
            action = json.loads(body)["action"]
            order = known[action]
        except (ValueError, KeyError, TypeError):
            return 422, {"message": "Validation Error"}
        self._controller.note(f"robot api: {action}")
        return order()

    def _knows_later(self) -> bool:
        return _numbers(self._version) >= _numbers(_LATER)

    def _stop(self) -> Reply:
        if self._controller.stop_orders.refused:
            return 409, {"message": "Program cannot be stopped"}
        self._controller.stop_program("robot api stop")
        return 200, {"message": "Program stopped"}

    def _power(self, mode: Robot) -> Reply:
        if mode is Robot.POWER_OFF and self._controller.stop_orders.refused:
            return 409, {"message": "Power cannot be switched off"}
        self._controller.power(mode)
        return 200, {"message": f"Robot mode {mode.name}"}

    def _unlock(self) -> Reply:
        if self._controller.unlock_protective_stop():
            return 200, {"message": "Protective stop unlocked"}
        return 409, {
            "message": "Cannot unlock protective stop",
            "details": "until 5s after occurrence. Always inspect cause before unlocking",
        }

    @staticmethod
    def _done(done: bool, action: str) -> Reply:
        return (200, {"message": action}) if done else (409, {"message": f"cannot {action}"})


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    # a header and a body in two packets would wait for the client's delayed acknowledgement
    wbufsize = -1
    disable_nagle_algorithm = True
    api: _Api

    def do_GET(self) -> None:
        self._serve("GET")

    def do_PUT(self) -> None:
        self._serve("PUT")

    def do_DELETE(self) -> None:
        self._serve("DELETE")

    def log_message(self, *_: Any) -> None:
        """Keep quiet."""

    def _serve(self, verb: str) -> None:
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        while self.api.faults().deaf:
            time.sleep(_POLL_S)
        status, reported = self.api.answer(verb, self.path.removeprefix(BASE), body)
        while self.api.faults().mute:
            time.sleep(_POLL_S)
        content = json.dumps(reported).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)
        self.wfile.flush()


def _missing(path: str) -> Reply:
    return 404, {"message": "Not Found", "details": path}


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))
