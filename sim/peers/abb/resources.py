"""What each RWS resource of the controller answers."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.units import millimetres, scalar_first
from drivers.arm import ArmState
from sim.peers.abb import panel_services
from sim.peers.abb.answers import DONE, NOT_ALLOWED, Answer, error, missing, state
from sim.peers.abb.event_log import EventLog
from sim.peers.abb.panel import ABBFaults
from sim.peers.abb.panel_services import RAMDISK, PanelServices
from sim.peers.controller_faults import StopOrders

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


class Resources:
    """Answers requests for one controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._services = PanelServices(controller)
        units = "rw/motionsystem/mechunits/ROB_1"
        self._robtarget_path = f"{units}/robtarget"
        self._gets: dict[str, Callable[[], Answer]] = {
            "rw/system": lambda: state({"_type": "sys-system", "rwversion": "6.14.00.01"}),
            "rw/panel/ctrlstate": lambda: state({"ctrlstate": controller.panel.controller}),
            "rw/panel/opmode": lambda: state({"opmode": controller.panel.mode}),
            "rw/rapid/execution": self._execution,
            "rw/rapid/tasks": self._tasks,
            "rw/elog/0": lambda: state(*controller.log.entries()),
            "ctrl/$RAMDISK": lambda: state({"_type": "ctrl-env", "_value": RAMDISK}),
            f"{units}/jointtarget": self._jointtarget,
        }
        self._posts: dict[tuple[str, str], Callable[[], Answer]] = {
            ("rw/rapid/execution", "start"): self._start,
            ("rw/rapid/execution", "stop"): self._stop,
            ("rw/rapid/execution", "resetpp"): lambda: DONE,
            ("rw/rapid/tasks/T_ROB1", "activate"): lambda: DONE,
            ("rw/panel/ctrlstate", "setctrlstate"): self._motors_off,
        }

    def faults(self) -> ABBFaults:
        """What goes wrong with the controller at present."""
        return self._controller.faults

    def answer(self, method: str, path: str, query: dict[str, str], body: bytes) -> Answer:
        """Return what a request gets."""
        self._controller.request_times_s.append(time.monotonic())
        answered = self._services.answer(method, path, query, body)
        if answered is not None:
            return answered
        if method == "GET" and path == self._robtarget_path:
            return self._robtarget(query)
        if method == "GET" and path in self._gets:
            return self._gets[path]()
        action = (path, query.get("action", ""))
        if method == "POST" and action in self._posts:
            return self._posts[action]()
        return missing(path)

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
            return NOT_ALLOWED
        if controller.running:
            return error(403, -1073442812, "RAPID is executing")
        controller.start()
        return DONE

    def _stop(self) -> Answer:
        self._controller.note("rws: stop")
        if self._controller.stop_orders.refused or self._controller.faults.rapid_stop_refused:
            return NOT_ALLOWED
        self._controller.stop("rws stop")
        return DONE

    def _motors_off(self) -> Answer:
        self._controller.note("rws: motors off")
        if self._controller.stop_orders.refused:
            return NOT_ALLOWED
        self._controller.panel.controller = "motoroff"
        self._controller.stop("motors off")
        return DONE
