"""The controller as its panel sees it: dashboard server or robot API, whichever it has."""

from __future__ import annotations

from typing import Protocol

from sim.peers.controller_faults import ControllerFaults, StopOrders
from sim.peers.ur.modes import Robot, Runtime, Safety


class PanelController(Protocol):
    """What dashboard server and robot API report of their controller, and what they order."""

    version: tuple[int, int, int, int]
    remote_control: bool
    robot_mode: Robot
    safety: Safety
    runtime: Runtime

    @property
    def faults(self) -> ControllerFaults:
        """What goes wrong with it."""

    @property
    def stop_orders(self) -> StopOrders:
        """How orders to stop are taken."""

    @property
    def model(self) -> str:
        """The arm's model, as the controller names it."""

    def note(self, what: str) -> None:
        """Remember that something arrived."""

    def stop_program(self, why: str) -> None:
        """End the program and its motion."""

    def play(self) -> bool:
        """Resume a paused program; return whether there was one."""

    def pause(self) -> bool:
        """Pause the program that runs, and its motion; return whether there was one."""

    def power(self, mode: Robot) -> None:
        """Switch the arm's power and brakes."""

    def unlock_protective_stop(self) -> bool:
        """Release a protective stop; return whether it was time."""
