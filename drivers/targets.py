"""Refuses a move that no driver would make, before anything moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from drivers.arm import MoveTarget
from drivers.errors import ArmStopped, DeviceRefused, SafetyError


def check_target(
    target: MoveTarget,
    *,
    max_joint_speed_rad_s: float,
    max_tcp_speed_m_s: float,
    joint_limits_rad: Sequence[tuple[float, float]],
) -> None:
    """Raise `SafetyError` with the reason unless the target is whole and within the bounds.

    Parameters
    ----------
    target:
        What the caller wants.
    max_joint_speed_rad_s, max_tcp_speed_m_s:
        The target's own bounds must be above zero and at most these.
    joint_limits_rad:
        Lowest and highest angle of each of the six joints.
    """
    if (target.joints_rad is None) == (target.base_from_flange is None):
        raise SafetyError("a move needs either joint angles or a flange pose, and not both")
    _check_speed("joint speed", target.joint_speed_rad_s, max_joint_speed_rad_s, "rad/s")
    _check_speed("flange speed", target.tcp_speed_m_s, max_tcp_speed_m_s, "m/s")
    if target.joints_rad is not None:
        _check_joints(target.joints_rad, joint_limits_rad)
    elif not np.isfinite(target.base_from_flange.as_matrix()).all():  # type: ignore[union-attr]
        raise SafetyError("the flange pose of a move is not finite")


def check_ready(fault: str | None, moving: bool, named: Callable[[str], str]) -> None:
    """Raise `ArmStopped` for an arm with a fault and `DeviceRefused` for one that still moves.

    `named` puts the device's name before a message.
    """
    if fault is not None:
        raise ArmStopped(named(fault))
    if moving:
        raise DeviceRefused(named("still moving: wait until it is steady, or stop it first"))


def _check_speed(name: str, value: float, limit: float, unit: str) -> None:
    if not 0.0 < value <= limit:
        raise SafetyError(f"{name} {value:g} {unit} is not above 0 and at most {limit:g} {unit}")


def _check_joints(joints_rad: Sequence[float], limits_rad: Sequence[tuple[float, float]]) -> None:
    if len(joints_rad) != len(limits_rad):
        raise SafetyError(f"{len(joints_rad)} joint angles for an arm of {len(limits_rad)} joints")
    for number, (angle, (low, high)) in enumerate(zip(joints_rad, limits_rad, strict=True), 1):
        if not math.isfinite(angle) or not low <= angle <= high:
            raise SafetyError(
                f"joint {number}: {angle:.4g} rad is outside its limits {low:.4g} to {high:.4g} rad"
            )
