"""Speeds for ``moveJ`` and ``moveL`` that keep the flange below the speed asked for.

The controller bounds the leading joint (moveJ) or the tool centre point (moveL); what the cell
asks for is a bound on the flange.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.arm import MoveTarget
from drivers.ur.kinematics_info import KinematicsInfo

_SAMPLES = 65
_LONGEST_REACH_M = 1.5  # UR10e 1.3 m and its wrist; for a controller that states no kinematics
_LEAST = 1e-3


def leading_joint_speed_rad_s(
    begin_rad: tuple[float, ...], target: MoveTarget, kinematics: KinematicsInfo | None
) -> float:
    """Return the speed of the leading joint that keeps every bound of the target.

    Without kinematics the flange is taken to be a full reach away from every joint, which is safe
    and slow.
    """
    assert target.joints_rad is not None
    begin, end = np.array(begin_rad), np.array(target.joints_rad)
    leading = np.abs(end - begin).max()
    if leading < _LEAST:
        return target.joint_speed_rad_s
    if kinematics is None:
        m_per_rad = float(np.abs(end - begin).sum() / leading * _LONGEST_REACH_M)
    else:
        path = begin + np.linspace(0.0, 1.0, _SAMPLES)[:, None] * (end - begin)
        steps = np.linalg.norm(np.diff(kinematics.flange_positions_m(path), axis=0), axis=1)
        m_per_rad = float(steps.max() * (_SAMPLES - 1) / leading)
    return min(target.joint_speed_rad_s, target.tcp_speed_m_s / max(m_per_rad, _LEAST))


def tcp_speed_m_s(
    begin: RigidTransform, target: MoveTarget, tcp_offset: tuple[float, ...]
) -> float:
    """Return the speed of the tool centre point that keeps the flange below its bound.

    The flange travels at most as far as the tool centre point and the arc of the offset between
    them together.
    """
    assert target.base_from_flange is not None
    motion = begin.inv() * target.base_from_flange
    tool = RigidTransform.from_translation(tcp_offset[:3])
    way_m = np.linalg.norm((motion * tool).translation - tool.translation)
    arc_m = motion.rotation.magnitude() * np.linalg.norm(tool.translation)
    share = way_m / (way_m + arc_m) if way_m + arc_m > 0 else 1.0
    return max(target.tcp_speed_m_s * float(share), _LEAST)
