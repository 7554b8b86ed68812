"""What each RWS resource of the controller answers."""

from __future__ import annotations

import time
from collections.abc import Callable

from sim.peers.abb.answers import DONE, NOT_ALLOWED, Answer, error, missing, state
from sim.peers.abb.arm_resources import UNIT, ArmResources, Controller, Envelope
from sim.peers.abb.panel import ABBFaults
from sim.peers.abb.panel_services import RAMDISK, PanelServices


class Resources:
    """Answers requests for one controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._services = PanelServices(controller)
        arm = self._arm = ArmResources(controller, Envelope(state, error, NOT_ALLOWED))
        self._gets: dict[str, Callable[[], Answer]] = {
            "rw/system": lambda: state({"_type": "sys-system", "rwversion": "6.14.00.01"}),
            "rw/panel/ctrlstate": lambda: state({"ctrlstate": controller.panel.controller}),
            "rw/panel/opmode": lambda: state({"opmode": controller.panel.mode}),
            "rw/rapid/execution": arm.execution,
            "rw/rapid/tasks": self._tasks,
            "rw/elog/0": lambda: state(*controller.log.entries()),
            "ctrl/$RAMDISK": lambda: state({"_type": "ctrl-env", "_value": RAMDISK}),
            f"{UNIT}/jointtarget": arm.jointtarget,
        }
        self._posts: dict[tuple[str, str], Callable[[], Answer]] = {
            ("rw/rapid/execution", "start"): arm.start,
            ("rw/rapid/execution", "stop"): arm.stop,
            ("rw/rapid/execution", "resetpp"): lambda: DONE,
            ("rw/rapid/tasks/T_ROB1", "activate"): lambda: DONE,
            ("rw/panel/ctrlstate", "setctrlstate"): arm.motors_off,
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
        if method == "GET" and path == f"{UNIT}/robtarget":
            return self._arm.robtarget(query)
        if method == "GET" and path in self._gets:
            return self._gets[path]()
        action = (path, query.get("action", ""))
        if method == "POST" and action in self._posts:
            return self._posts[action]()
        return missing(path)

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
