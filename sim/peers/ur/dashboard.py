"""The controller's dashboard server, port 29999: one line in, one line out.

Source: Universal Robots, "Dashboard Server e-Series" (commands and answers).
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim.peers.ur.controller import URController

_UNLOCK_TOO_EARLY = (
    "Cannot unlock protective stop until 5s after occurrence. "
    "Always inspect cause of protective stop before unlocking"
)
_LOCAL = "Not in remote control"


class DashboardServer:
    """Serves dashboard clients of one controller."""

    def __init__(self, controller: URController) -> None:
        self._controller = controller
        self._questions: dict[str, Callable[[], str]] = {
            "polyscopeversion": self._polyscope,
            "get serial number": lambda: "20195500001",
            "get robot model": lambda: "UR5",
            "is in remote control": lambda: str(controller.remote_control).lower(),
            "robotmode": lambda: f"Robotmode: {controller.robot_mode.name}",
            "safetystatus": lambda: f"Safetystatus: {controller.safety.name}",
            "programstate": lambda: f"{controller.runtime.name} rtde_control",
            "running": lambda: f"Program running: {str(controller.runtime == 2).lower()}",
            "close safety popup": lambda: "closing safety popup",
        }
        self._orders: dict[str, Callable[[], str]] = {
            "stop": self._stop,
            "play": self._play,
            "unlock protective stop": self._unlock,
        }

    def serve(self, link: socket.socket) -> None:
        """Answer one client until it goes."""
        if not self._controller.mute:
            link.sendall(b"Connected: Universal Robots Dashboard Server\n")
        for line in link.makefile("r", encoding="utf-8"):
            if self._controller.deaf:
                continue
            answer = self._answer(line.strip())
            if not self._controller.mute:
                link.sendall(f"{answer}\n".encode())

    def _answer(self, line: str) -> str:
        command = line.lower()
        if command in self._questions:
            return self._questions[command]()
        if command not in self._orders:
            return f"could not understand: '{line}'"
        self._controller.note(f"dashboard: {command}")
        return self._orders[command]() if self._controller.remote_control else _LOCAL

    def _polyscope(self) -> str:
        return "URSoftware {}.{}.{}.{} (Jun 09 2023)".format(*self._controller.version)

    def _stop(self) -> str:
        self._controller.stop_program("dashboard stop")
        return "Stopped"

    def _play(self) -> str:
        return "Starting program" if self._controller.play() else "Failed to execute: play"

    def _unlock(self) -> str:
        unlocked = self._controller.unlock_protective_stop()
        return "Protective stop releasing" if unlocked else _UNLOCK_TOO_EARLY
