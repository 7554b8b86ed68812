"""What the script that ur-rtde uploads does on the controller, emulated at its registers.

The client writes a command number into ``input_int_register_0`` and its arguments into the double
registers; the script answers in ``output_int_register_0`` with READY or DONE. Numbers and registers
were read off the wheel's own script and confirmed by running the wheel against this file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from calib.chain.kinematics import ArmKinematics
from drivers.arm import MoveTarget
from drivers.ur.pose import base_from_flange
from sim.peers.ur.kinematic_answers import KinematicAnswers, NoSolution
from sim.peers.ur.registers import ScriptRegisters

READY, DONE = 1, 2
MOVE_J, MOVE_J_IK, MOVE_L, MOVE_L_FK = 1, 2, 3, 4
SET_PAYLOAD, SET_TCP, STOP_L, STOP_J, SET_WATCHDOG = 17, 29, 33, 34, 35
GET_TCP_OFFSET, IS_STEADY = 40, 47
KICK, STOP_SCRIPT = 99, 255
_RUNNING = 1 << 15


class Controller(Protocol):
    """What the program reads and orders of the controller it runs on."""

    registers: dict[str, int | float]
    tcp_offset: tuple[float, ...]
    payload_kg: float
    payload_cog_m: tuple[float, ...]
    kinematics: ArmKinematics | None

    @staticmethod
    def now() -> float:
        """Host clock in seconds."""

    def begin_move(self, target: MoveTarget) -> None:
        """Start a motion of the program."""

    def joints_rad(self) -> tuple[float, ...]:
        """Present joint angles."""

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
        self._registers = ScriptRegisters(controller.registers, source)
        self._kinematics = KinematicAnswers(controller, self._registers)
        self._busy: Callable[[], bool] | None = None
        self._operation = 0
        self._changes = 0
        self._async_running = False
        self._watchdog_s: float | None = None
        self._kicked_s = controller.now()
        self._actions: dict[int, Callable[[], None]] = {
            MOVE_J: lambda: self._move(self._joint_target()),
            MOVE_J_IK: lambda: self._move(self._pose_target(straight=False)),
            MOVE_L: lambda: self._move(self._pose_target(straight=True)),
            MOVE_L_FK: lambda: self._move(self._straight_to_joints()),
            STOP_L: self._stop,
            STOP_J: self._stop,
            SET_PAYLOAD: self._set_payload,
            SET_TCP: self._set_tcp,
            SET_WATCHDOG: self._set_watchdog,
            GET_TCP_OFFSET: lambda: self._registers.set_out_doubles(controller.tcp_offset),
            IS_STEADY: lambda: self._registers.set_out(1, int(controller.steady())),
            **self._kinematics.actions,
        }
        self._registers.set_out(0, READY)
        self._registers.set_out(2, 0)

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
        registers = self._registers
        if self._busy is not None:
            if self._busy():
                self._busy = None
                registers.set_out(0, DONE)
            return
        command = registers.in_int(0)
        if registers.out(0) == READY and command:
            self._execute(command)
        elif registers.out(0) == DONE and not command:
            registers.set_out(0, READY)

    def _execute(self, command: int) -> None:
        if command == STOP_SCRIPT:
            self._controller.stop_program("script ended by its client")
            return
        try:
            self._actions.get(command, lambda: None)()
        except NoSolution as none:
            self._controller.stop_program(f"runtime error in the script: {none}")
            return
        if self._busy is None:
            self._registers.set_out(0, DONE)

    def _speed(self) -> float:
        return self._registers.in_doubles(6, 1)[0]

    def _joint_target(self) -> MoveTarget:
        joints = self._registers.in_doubles(0)
        return MoveTarget(joints_rad=joints, joint_speed_rad_s=self._speed(), tcp_speed_m_s=10.0)

    def _pose_target(self, *, straight: bool) -> MoveTarget:
        pose = self._registers.in_doubles(0)
        return MoveTarget(
            base_from_flange=base_from_flange(pose, self._controller.tcp_offset),
            tcp_speed_m_s=self._speed() if straight else 10.0,
            joint_speed_rad_s=3.14 if straight else self._speed(),
        )

    def _straight_to_joints(self) -> MoveTarget:
        return MoveTarget(
            base_from_flange=self._kinematics.forward(self._registers.in_doubles(0)),
            tcp_speed_m_s=self._speed(),
            joint_speed_rad_s=3.14,
        )

    def _move(self, target: MoveTarget) -> None:
        controller = self._controller
        controller.begin_move(target)
        if self._registers.in_int(1):
            self._operation = (self._operation + 1) % 128
            self._progress(running=True)
        else:
            self._busy = controller.at_rest

    def _stop(self) -> None:
        self._controller.stop_motion("script's own stop")
        self._busy = self._controller.at_rest

    def _set_payload(self) -> None:
        mass, *centre = self._registers.in_doubles(0, 4)
        self._controller.payload_kg, self._controller.payload_cog_m = mass, tuple(centre)

    def _set_tcp(self) -> None:
        self._controller.tcp_offset = self._registers.in_doubles(0)

    def _set_watchdog(self) -> None:
        self._watchdog_s = 1.0 / self._registers.in_doubles(0, 1)[0]

    def _progress(self, *, running: bool) -> None:
        self._async_running = running
        self._changes = (self._changes + 1) % 128
        word = (self._operation << 24) | (self._changes << 16) | (_RUNNING if running else 0)
        self._registers.set_out(2, word)
