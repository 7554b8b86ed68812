"""What the arm's resources answer in either generation of Robot Web Services."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.units import millimetres, scalar_first
from drivers.arm import ArmState
from sim.peers.abb import panel_services
from sim.peers.abb.answers import DONE, Answer
from sim.peers.abb.event_log import EventLog
from sim.peers.abb.panel import ABBFaults
from sim.peers.controller_faults import StopOrders

UNIT = "rw/motionsystem/mechunits/ROB_1"
_UNUSED_AXIS = "9E+09"


class Controller(panel_services.Controller, Protocol):
    """What the resources report of their controller, and what they order."""

    running: bool
    faults: ABBFaults
    log: EventLog
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


@dataclass(frozen=True)
class Envelope:
    """How a generation wraps what it answers.

    Attributes
    ----------
    state:
        An answer with a resource's states.
    error:
        A refusal: HTTP status, RWS code, message.
    not_allowed:
        The refusal of what the controller's state does not permit.
    """

    state: Callable[..., Answer]
    error: Callable[[int, int, str], Answer]
    not_allowed: Answer


class ArmResources:
    """Joints, flange pose and execution of one controller, read and ordered."""

    def __init__(self, controller: Controller, envelope: Envelope) -> None:
        self._controller = controller
        self._envelope = envelope

    def execution(self) -> Answer:
        """Whether RAPID runs."""
        running = "running" if self._controller.running else "stopped"
        entry = {"_type": "rap-execution", "ctrlexecstate": running, "cycle": "once"}
        return self._envelope.state(entry)

    def jointtarget(self) -> Answer:
        """Joint angles, degrees."""
        joints = np.degrees(self._controller.reported().joints_rad or ())
        entry = {f"rax_{i}": f"{angle:.6f}" for i, angle in enumerate(joints, 1)}
        entry |= {f"eax_{letter}": _UNUSED_AXIS for letter in "abcdef"}
        return self._envelope.state({"_type": "ms-jointtarget", **entry})

    def robtarget(self, query: dict[str, str]) -> Answer:
        """The active tool in the world, or what `query` asks for; millimetres, w x y z."""
        pose = self._controller.reported().base_from_flange
        if query.get("coordinate") != "Base":
            pose = self._controller.world_from_base * pose
        if query.get("tool") != "tool0":
            pose = pose * self._controller.flange_from_active_tool
        entry = dict(zip("xyz", (f"{v:.5f}" for v in millimetres(pose)), strict=True))
        entry |= {f"q{i}": f"{v:.9f}" for i, v in enumerate(scalar_first(pose), 1)}
        entry |= dict.fromkeys(("cf1", "cf4", "cf6", "cfx"), "0")
        entry |= {f"eax{letter}": _UNUSED_AXIS for letter in "abcdef"}
        return self._envelope.state({"_type": "ms-robtargets", **entry})

    def start(self) -> Answer:
        """Start RAPID, where the panel permits it."""
        controller = self._controller
        controller.note("rws: start")
        if controller.panel.mode != "AUTO" or controller.panel.controller != "motoron":
            return self._envelope.not_allowed
        if controller.running:
            return self._envelope.error(403, -1073442812, "RAPID is executing")
        controller.start()
        return DONE

    def stop(self) -> Answer:
        """Stop RAPID, unless the order is refused."""
        self._controller.note("rws: stop")
        if self._controller.stop_orders.refused or self._controller.faults.rapid_stop_refused:
            return self._envelope.not_allowed
        self._controller.stop("rws stop")
        return DONE

    def motors_off(self, *, understood: bool = True) -> Answer:
        """Switch the motors off, which stops the arm."""
        self._controller.note("rws: motors off")
        if self._controller.stop_orders.refused or not understood:
            return self._envelope.not_allowed
        self._controller.panel.controller = "motoroff"
        self._controller.stop("motors off")
        return DONE
