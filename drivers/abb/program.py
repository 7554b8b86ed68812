"""Motion programs of one motion, built with abb-motion-program-exec."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.readings import Reading
from drivers.abb.units import millimetres, scalar_first
from drivers.arm import MoveTarget

_ARRIVED_RAD, _ARRIVED_M = 0.01, 0.002
_LINEAR_AXES_MM_S, _ROTARY_AXES_DEG_S = 5000.0, 1000.0


def build_program(target: MoveTarget, reading: Reading, world_from_base: RigidTransform) -> Any:
    """Return the program that makes one move and stops there (zone ``fine``).

    Joint targets become MoveAbsJ, poses MoveL in the present axis configuration. The speed data
    bound the flange, by `tcp_speed_m_s`, and its turning, by `joint_speed_rad_s`; the joints are
    bounded by the controller's own limits only, RAPID has no speed of a joint.
    """
    from abb_motion_program_exec import abb_motion_program_exec_client as client

    speed = client.speeddata(
        target.tcp_speed_m_s * 1000.0,
        math.degrees(target.joint_speed_rad_s),
        _LINEAR_AXES_MM_S,
        _ROTARY_AXES_DEG_S,
    )
    program = client.MotionProgram(tool=client.tool0, wobj=client.wobj0)
    external = list(reading.external)
    if target.joints_rad is not None:
        joints = np.degrees(target.joints_rad).tolist()
        program.MoveAbsJ(client.jointtarget(joints, external), speed, client.fine)
    else:
        assert target.base_from_flange is not None
        pose = world_from_base * target.base_from_flange
        goal = client.robtarget(
            millimetres(pose).tolist(),
            scalar_first(pose).tolist(),
            client.confdata(*reading.configuration),
            external,
        )
        program.MoveL(goal, speed, client.fine)
    return program


def missed(target: MoveTarget, reading: Reading) -> str | None:
    """Return how far from its target the arm stands, or None where it arrived."""
    off_m, off_rad = _off(target, reading)
    if off_m <= _ARRIVED_M and off_rad <= _ARRIVED_RAD:
        return None
    return f"{off_rad:.3f} rad" if off_m == 0.0 else f"{off_m * 1e3:.1f} mm and {off_rad:.3f} rad"


def way_left(target: MoveTarget, reading: Reading) -> float:
    """Return how far the arm still has to go, in metres or radians: whichever are more."""
    return max(_off(target, reading))


def _off(target: MoveTarget, reading: Reading) -> tuple[float, float]:
    if target.joints_rad is not None:
        return 0.0, float(np.abs(np.subtract(reading.joints_rad, target.joints_rad)).max())
    assert target.base_from_flange is not None
    off = reading.base_from_flange.inv() * target.base_from_flange
    return float(np.linalg.norm(off.translation)), float(off.rotation.magnitude())
