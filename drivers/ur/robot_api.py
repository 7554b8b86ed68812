"""PolyScope X's robot API: HTTP and JSON in the place of the dashboard server.

Source: Universal Robots, "Robot API" (OpenAPI document of the controller, versions 3.1 to 5.0; from
PolyScope X 10.11), and what Universal Robots' own client library asks of it: control mode and robot
mode exist from 10.12, version, model and serial number from 10.14. Orders are refused with status
403 in local mode and 409 in a state that does not allow them.
"""

from __future__ import annotations

import json
import threading
import time
from typing import Any

from drivers.bounded_http import BoundedHttp, NoAnswer
from drivers.errors import DeviceRefused, DeviceUnreachable
from drivers.outside import parse_json, printable
from drivers.ur.panel import StopOrder

ROBOT_API_PORT = 80
BASE = "/universal-robots/robot-api"
_LARGEST_ANSWER_BYTES = 1 << 22
_OK, _FORBIDDEN, _NOT_FOUND = range(200, 300), 403, 404


class RobotApi:
    """One connection to the robot API.

    Parameters
    ----------
    host, port:
        Of the controller.
    timeout_s:
        Of every question.
    """

    def __init__(self, host: str, port: int = ROBOT_API_PORT, timeout_s: float = 2.0) -> None:
        self._host, self._port, self._timeout_s = host, port, timeout_s
        self._http = BoundedHttp(host, port, _LARGEST_ANSWER_BYTES)
        self._lock = threading.Lock()

    @property
    def stop_order(self) -> StopOrder:
        """What ends the program that runs."""
        stop = self._request("/program/v1/state", "stop")
        off = self._request("/robotstate/v1/state", "POWER_OFF")
        return StopOrder("robot API", self._port, stop, off)

    def version(self) -> str:
        """Version of the API; raises `DeviceUnreachable` where there is none."""
        info = self._get("/openapi.json").get("info")
        version = info.get("version") if isinstance(info, dict) else None
        if not isinstance(version, str):
            raise DeviceUnreachable(
                f"UR controller {self._host}: port {self._port} speaks HTTP and no robot API"
            )
        return printable(version)

    def identity(self) -> dict[str, str]:
        """Version, model and serial number, as far as the controller reports them."""
        reported = {"robot_api": self.version()}
        places = {
            "polyscope": ("/versions/v1", "marketingVersion"),
            "model": ("/system/v1/information", "robotType"),
            "serial": ("/system/v1/information", "serialNumber"),
        }
        for name, (path, key) in places.items():
            value = self._get(path).get(key)
            if isinstance(value, str):
                reported[name] = printable(value)
        return reported

    def in_local_mode(self) -> bool:
        """Whether programs from outside are ignored; False where the controller cannot say."""
        return self._mode("/system/v1/controlmode") == "LOCAL"

    def safety(self) -> str:
        """The safety mode."""
        return self._mode("/robotstate/v1/safetymode")

    def robot_mode(self) -> str:
        """The arm's mode."""
        return self._mode("/robotstate/v1/robotmode")

    def stop_program(self) -> None:
        """End the program that runs; that none runs is no fault."""
        self._put("/program/v1/state", "stop")

    def unlock_protective_stop(self) -> str | None:
        """Release a protective stop; return None, or why the controller does not."""
        self._ask("DELETE", "/popup/v1/safety")  # which PolyScope X has from 10.14
        return self._put("/robotstate/v1/state", "UNLOCK_PROTECTIVE_STOP")

    def close(self) -> None:
        """Let go of the controller."""
        with self._lock:
            self._http.close()

    def _request(self, path: str, action: str) -> bytes:
        body = json.dumps({"action": action})
        head = (
            f"PUT {BASE}{path} HTTP/1.1\r\nHost: {self._host}\r\n"
            f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        return f"{head}{body}".encode()

    def _mode(self, path: str) -> str:
        mode = self._get(path).get("mode")
        return printable(mode) if isinstance(mode, str) else "not reported"

    def _get(self, path: str) -> dict[str, Any]:
        """The answer to a question; empty where this version does not know it."""
        status, reported = self._ask("GET", path)
        return reported if status in _OK else {}

    def _put(self, path: str, action: str) -> str | None:
        """Order something; return None, or why it is refused."""
        status, reported = self._ask("PUT", path, json.dumps({"action": action}))
        if status in _OK:
            return None
        if status == _FORBIDDEN:
            raise DeviceRefused(
                f"UR controller {self._host}: refuses '{action}' in local mode: switch to Remote "
                "on the safety screen of the teach pendant (in automatic mode)"
            )
        details = " ".join(
            str(reported[key]) for key in ("message", "details") if reported.get(key)
        )
        return printable(details) or f"HTTP status {status}"

    def _ask(self, verb: str, path: str, body: str | None = None) -> tuple[int, dict[str, Any]]:
        with self._lock:
            deadline_s = time.monotonic() + self._timeout_s
            try:
                status, answer = self._http.ask(
                    verb, f"{BASE}{path}", deadline_s, body, "application/json"
                )
            except NoAnswer as error:
                raise DeviceUnreachable(
                    f"UR controller {self._host}: the robot API (port {self._port}) did not "
                    f"answer ({error}). Check power, cable and address"
                ) from None
        try:
            reported = parse_json(answer) if answer else {}
        except ValueError:
            reported = {}
        return status, reported if isinstance(reported, dict) else {}
