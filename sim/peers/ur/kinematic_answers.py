"""What the controller answers to a script's questions about its kinematics.

Source: Universal Robots, "The URScript Programming Language": get_forward_kin, get_inverse_kin,
get_inverse_kin_has_solution, is_within_safety_limits. Poses are those of the tool centre point.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import ArmKinematics, OutOfReach
from drivers.ur.pose import base_from_flange, base_from_tcp, pose_of
from sim.peers.ur.registers import ScriptRegisters

POSE_WITHIN_LIMITS, JOINTS_WITHIN_LIMITS = 36, 37
FORWARD_NOW, FORWARD = 43, 44
INVERSE_NEAR, INVERSE, HAS_INVERSE, HAS_INVERSE_NEAR = 30, 46, 60, 61
FLANGE_POSE = 58
_TOOL0 = (0.0,) * 6


class NoSolution(Exception):
    """URScript's ``get_inverse_kin`` ends the program where there is none."""


class Controller(Protocol):
    """Whose kinematics are asked for."""

    tcp_offset: tuple[float, ...]
    kinematics: ArmKinematics | None

    def joints_rad(self) -> tuple[float, ...]:
        """Present joint angles."""


class KinematicAnswers:
    """Answers commands by their numbers, in the registers of a script; raises `NoSolution`."""

    def __init__(self, controller: Controller, registers: ScriptRegisters) -> None:
        self._controller, self._registers = controller, registers
        self.actions: dict[int, Callable[[], None]] = {
            FORWARD_NOW: lambda: self._answer_forward(
                controller.joints_rad(), controller.tcp_offset
            ),
            FORWARD: lambda: self._answer_forward(registers.in_doubles(0), registers.in_doubles(6)),
            FLANGE_POSE: lambda: self._answer_forward(controller.joints_rad(), _TOOL0),
            INVERSE: lambda: registers.set_out_doubles(self._inverse(controller.joints_rad())),
            INVERSE_NEAR: lambda: registers.set_out_doubles(self._inverse(registers.in_doubles(6))),
            HAS_INVERSE: self._answer_reachable,
            HAS_INVERSE_NEAR: self._answer_reachable,
            POSE_WITHIN_LIMITS: self._answer_reachable,
            JOINTS_WITHIN_LIMITS: self._answer_within_limits,
        }

    def forward(self, joints_rad: tuple[float, ...]) -> RigidTransform:
        """base_from_flange at some joint angles."""
        return RigidTransform.from_matrix(self._kinematics.forward(np.array(joints_rad)))

    @property
    def _kinematics(self) -> ArmKinematics:
        if self._controller.kinematics is None:
            raise NoSolution("this controller was given no kinematics")
        return self._controller.kinematics

    def _answer_forward(self, joints_rad: tuple[float, ...], offset: tuple[float, ...]) -> None:
        self._registers.set_out_doubles(pose_of(base_from_tcp(self.forward(joints_rad), offset)))

    def _inverse(self, near_rad: tuple[float, ...]) -> tuple[float, ...]:
        flange = base_from_flange(self._registers.in_doubles(0), self._controller.tcp_offset)
        try:
            found = self._kinematics.inverse(flange.as_matrix(), np.array(near_rad))
        except OutOfReach as far:
            raise NoSolution(str(far)) from None
        return tuple(found.tolist())

    def _answer_reachable(self) -> None:
        try:
            self._inverse(self._controller.joints_rad())
        except NoSolution:
            self._registers.set_out(1, 0)
        else:
            self._registers.set_out(1, 1)

    def _answer_within_limits(self) -> None:
        joints = np.array(self._registers.in_doubles(0))
        self._registers.set_out(1, int(self._kinematics.within_limits(joints)))
