"""The controller's script port, 30003: URScript programs in.

A program is what stands between ``def name():`` and ``end``, or a single line. It takes the place
of the program that runs. A connection made in local mode is read-only and stays so after a switch
to remote control, as on an e-Series.
"""

from __future__ import annotations

import socket
from typing import Protocol

from sim.peers.controller_faults import ControllerFaults


class Controller(Protocol):
    """What programs are handed to."""

    remote_control: bool

    @property
    def faults(self) -> ControllerFaults:
        """What goes wrong with it."""

    def note(self, what: str) -> None:
        """Remember that something arrived."""

    def load(self, source: str) -> None:
        """Run a program in place of the one that runs."""


class ScriptServer:
    """Serves script clients of one controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller

    def serve(self, link: socket.socket) -> None:
        """Run whatever one client sends until it goes."""
        writable = self._controller.remote_control
        program: list[str] = []
        for line in link.makefile("r", encoding="utf-8"):
            if self._controller.faults.deaf or not writable:
                continue
            program.append(line)
            if line.rstrip() == "end" or not program[0].startswith("def "):
                self._run("".join(program))
                program = []

    def _run(self, source: str) -> None:
        if not source.strip():
            return
        self._controller.note(f"script: {source.split(':')[0].strip()}")
        if self._controller.remote_control:
            self._controller.load(source)
