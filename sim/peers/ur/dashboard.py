"""The controller's dashboard server, port 29999: one line in, one line out.

Source: Universal Robots, "Dashboard Server e-Series" (commands and answers).
"""

from __future__ import annotations

import socket
from collections.abc import Callable

from sim.peers.ur.modes import Robot
from sim.peers.ur.panel_controller import PanelController

_UNLOCK_TOO_EARLY = (
    "Cannot unlock protective stop until 5s after occurrence. "
    "Always inspect cause of protective stop before unlocking"
)
_LOCAL = "Not in remote control"
_GOODBYE = "Disconnected"


class DashboardServer:
    """Serves dashboard clients of one controller."""

    def __init__(self, controller: PanelController) -> None:
        self._controller = controller
        self._questions: dict[str, Callable[[], str]] = {
            "polyscopeversion": self._polyscope,
            "get serial number": lambda: "20195500001",
            "get robot model": lambda: controller.model,
            "is in remote control": lambda: str(controller.remote_control).lower(),
            "robotmode": lambda: f"Robotmode: {controller.robot_mode.name}",
            "safetystatus": lambda: f"Safetystatus: {controller.safety.name}",
            "programstate": lambda: f"{controller.runtime.name} rtde_control",
            "running": lambda: f"Program running: {str(controller.runtime == 2).lower()}",
            "safetymode": lambda: f"Safetymode: {controller.safety.name}",
            "get loaded program": lambda: "No program loaded",
            "isprogramsaved": lambda: "false <unnamed>",
            "get operational mode": lambda: "NONE",
            "close safety popup": lambda: "closing safety popup",
            "close popup": lambda: "closing popup",
        }
        self._texts = {"popup": "showing popup", "addtolog": "Added log message"}
        self._orders: dict[str, Callable[[], str]] = {
            "stop": self._stop,
            "play": self._play,
            "pause": self._pause,
            "unlock protective stop": self._unlock,
            "power on": lambda: self._power(Robot.IDLE, "Powering on"),
            "power off": lambda: self._power(Robot.POWER_OFF, "Powering off"),
            "brake release": lambda: self._power(Robot.RUNNING, "Brake releasing"),
            "restart safety": lambda: "Restarting safety",
        }

    def serve(self, link: socket.socket) -> None:
        """Answer one client until it goes."""
        if not self._controller.faults.mute:
            link.sendall(b"Connected: Universal Robots Dashboard Server\n")
        for line in link.makefile("r", encoding="utf-8"):
            if self._controller.faults.deaf:
                continue
            answer = self._answer(line.strip())
            if not self._controller.faults.mute:
                link.sendall(f"{answer}\n".encode())
            if answer == _GOODBYE:
                return

    def _answer(self, line: str) -> str:
        command = line.lower()
        if command in self._questions:
            return self._questions[command]()
        if command == "quit":
            return _GOODBYE
        if command.split(" ")[0] in self._texts:
            return self._texts[command.split(" ")[0]]
        if command not in self._orders:
            return f"could not understand: '{line}'"
        self._controller.note(f"dashboard: {command}")
        return self._orders[command]() if self._controller.remote_control else _LOCAL

    def _polyscope(self) -> str:
        return "URSoftware {}.{}.{}.{} (Jun 09 2023)".format(*self._controller.version)

    def _stop(self) -> str:
        if self._controller.stop_orders.refused:
            return "Failed to execute: stop"
        self._controller.stop_program("dashboard stop")
        return "Stopped"

    def _play(self) -> str:
        return "Starting program" if self._controller.play() else "Failed to execute: play"

    def _pause(self) -> str:
        return "Pausing program" if self._controller.pause() else "Failed to execute: pause"

    def _power(self, mode: Robot, answer: str) -> str:
        if mode is Robot.POWER_OFF and self._controller.stop_orders.refused:
            return "Failed to execute: power off"
        self._controller.power(mode)
        return answer

    def _unlock(self) -> str:
        unlocked = self._controller.unlock_protective_stop()
        return "Protective stop releasing" if unlocked else _UNLOCK_TOO_EARLY
