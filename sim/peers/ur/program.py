"""What the script that ur-rtde uploads does on the controller, emulated at its registers.

The client writes a command number into ``input_int_register_0`` and its arguments into the double
registers; the script answers in ``output_int_register_0`` with READY or DONE. Numbers and registers
were read off the wheel's own script and confirmed by running the wheel against this file.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Protocol

from drivers.arm import MoveTarget
from drivers.ur.pose import base_from_flange

READY, DONE = 1, 2
MOVE_J, MOVE_J_IK, MOVE_L = 1, 2, 3
SET_TCP, STOP_L, STOP_J, SET_WATCHDOG, GET_TCP_OFFSET, IS_STEADY = 29, 33, 34, 35, 40, 47
KICK, STOP_SCRIPT = 99, 255
_RUNNING = 1 << 15


class Controller(Protocol):
    """What the program reads and orders of the controller it runs on."""

    registers: dict[str, int | float]
    tcp_offset: tuple[float, ...]

    @staticmethod
    def now() -> float:
        """Host clock in seconds."""

    def begin_move(self, target: MoveTarget) -> None:
        """Start a motion of the program."""

    def at_rest(self) -> bool:
        """Whether the arm has come to rest."""

    def steady(self) -> bool:
        """Whether it has been at rest for long enough to be called steady."""

    def stop_motion(self, why: str) -> None:
        """End the motion, not the program."""

    def stop_program(self, why: str) -> None:
        """End the program and its motion."""


class ControlProgram:
    """The uploaded control script, loaded on one controller.

    Parameters
    ----------
    controller:
        The controller it runs on.
    source:
        The script's text; only the register offset is read from it.
    """

    def __init__(self, controller: Controller, source: str) -> None:
        self._controller = controller
        # the client puts the number behind the comment that marks its place
        offset = re.search(r"# int register offset\s+(\d+)", source)
        self._offset = int(offset.group(1)) if offset else 0
        self._busy: Callable[[], bool] | None = None
        self._operation = 0
        self._changes = 0
        self._async_running = False
        self._watchdog_s: float | None = None
        self._kicked_s = controller.now()
        self._answer(READY)
        self._set_out(2, 0)

    def kick(self) -> None:
        """An input update for the command register came in."""
        self._kicked_s = self._controller.now()

    def watchdog_expired(self) -> bool:
        """Whether the client promised updates and they ceased."""
        silence_s = self._controller.now() - self._kicked_s
        return self._watchdog_s is not None and silence_s > self._watchdog_s

    def tick(self) -> None:
        """One cycle of the script's main loop."""
        if self._async_running and self._controller.at_rest():
            self._progress(running=False)
        if self._busy is not None:
            if self._busy():
                self._busy = None
                self._answer(DONE)
            return
        command = int(self._in_int(0))
        if self._out(0) == READY and command:
            self._execute(command)
        elif self._out(0) == DONE and not command:
            self._answer(READY)

    def _execute(self, command: int) -> None:
        if command == STOP_SCRIPT:
            self._controller.stop_program("script ended by its client")
            return
        actions: dict[int, Callable[[int], None]] = {
            MOVE_J: self._move,
            MOVE_J_IK: self._move,
            MOVE_L: self._move,
            STOP_L: self._stop,
            STOP_J: self._stop,
            SET_TCP: self._set_tcp,
            SET_WATCHDOG: self._set_watchdog,
            GET_TCP_OFFSET: self._get_tcp,
            IS_STEADY: self._is_steady,
        }
        if command in actions:
            actions[command](command)
        if self._busy is None:
            self._answer(DONE)

    def _move(self, command: int) -> None:
        controller = self._controller
        numbers, speed = self._in_doubles(0, 6), float(self._in_doubles(6, 1)[0])
        if command == MOVE_J:
            target = MoveTarget(joints_rad=numbers, joint_speed_rad_s=speed, tcp_speed_m_s=10.0)
        else:
            target = MoveTarget(
                base_from_flange=base_from_flange(numbers, controller.tcp_offset),
                tcp_speed_m_s=speed if command == MOVE_L else 10.0,
                joint_speed_rad_s=3.14 if command == MOVE_L else speed,
            )
        controller.begin_move(target)
        if self._in_int(1):
            self._operation = (self._operation + 1) % 128
            self._progress(running=True)
        else:
            self._busy = controller.at_rest

    def _stop(self, command: int) -> None:
        self._controller.stop_motion(f"script command {command}")
        self._busy = self._controller.at_rest

    def _set_tcp(self, _: int) -> None:
        self._controller.tcp_offset = self._in_doubles(0, 6)

    def _get_tcp(self, _: int) -> None:
        for index, value in enumerate(self._controller.tcp_offset):
            name = f"output_double_register_{index + self._offset}"
            self._controller.registers[name] = value

    def _is_steady(self, _: int) -> None:
        self._set_out(1, int(self._controller.steady()))

    def _set_watchdog(self, _: int) -> None:
        self._watchdog_s = 1.0 / self._in_doubles(0, 1)[0]

    def _progress(self, *, running: bool) -> None:
        self._async_running = running
        self._changes = (self._changes + 1) % 128
        word = (self._operation << 24) | (self._changes << 16) | (_RUNNING if running else 0)
        self._set_out(2, word)

    def _answer(self, value: int) -> None:
        self._set_out(0, value)

    def _in_int(self, index: int) -> int:
        name = f"input_int_register_{index + self._offset}"
        return int(self._controller.registers.get(name, 0))

    def _in_doubles(self, first: int, count: int) -> tuple[float, ...]:
        start = first + self._offset
        names = (f"input_double_register_{index}" for index in range(start, start + count))
        return tuple(float(self._controller.registers.get(name, 0.0)) for name in names)

    def _out(self, index: int) -> int:
        return int(self._controller.registers[f"output_int_register_{index + self._offset}"])

    def _set_out(self, index: int, value: int) -> None:
        self._controller.registers[f"output_int_register_{index + self._offset}"] = value
