"""Whether a controller is set as the cell file says: asked before the first move."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.kinematics import ArmKinematics
from cell.storage.files.cell_file import RobotFile
from drivers.errors import SafetyError

_TCP_M, _TCP_RAD = 0.001, float(np.radians(0.5))
_PAYLOAD_KG, _PAYLOAD_SHARE = 0.05, 0.05
_LIMIT_RAD = 1e-3


def check_as_configured(robot: RobotFile, arm: ArmKinematics, raw: Mapping[str, Any]) -> None:
    """Raise `SafetyError`, with both values, for each setting that differs from the cell file's.

    Parameters
    ----------
    robot, arm:
        Of the cell file, its joint limits narrowed as the file says.
    raw:
        Of a reading. What controller or file do not state is not compared.
    """
    wrong = [*tcp_differs(robot, raw), *payload_differs(robot, raw), *limits_differ(arm, raw)]
    if wrong:
        raise SafetyError(f"the controller is not set as the cell file says: {'; '.join(wrong)}")


def tcp_differs(robot: RobotFile, raw: Mapping[str, Any]) -> list[str]:
    """The tool centre point: a millimetre or half a degree is another one."""
    reported = raw.get("tcp_offset")
    if robot.tcp is None or reported is None:
        return []
    named = robot.tcp.transform()
    offset = RigidTransform.from_components(reported[:3], Rotation.from_rotvec(reported[3:]))
    off = named.inv() * offset
    if float(np.linalg.norm(off.translation)) <= _TCP_M and off.rotation.magnitude() <= _TCP_RAD:
        return []
    return [
        f"robot.tcp is {_pose(named)}, the controller's tool centre point {_pose(offset)}:"
        " set it at the pendant, or correct the file"
    ]


def payload_differs(robot: RobotFile, raw: Mapping[str, Any]) -> list[str]:
    """The payload, where the file gives one."""
    reported, named = raw.get("payload"), robot.payload_kg
    if named == 0.0 or reported is None:
        return []
    if abs(reported - named) <= _PAYLOAD_KG + _PAYLOAD_SHARE * named:
        return []
    return [
        f"robot.payload_kg is {named:g} kg, the controller's payload {reported:g} kg: an arm that"
        " does not know its load sags and trips; set it at the pendant, or correct the file"
    ]


def limits_differ(arm: ArmKinematics, raw: Mapping[str, Any]) -> list[str]:
    """Joint limits of the controller's safety settings that are narrower than the cell's."""
    reported = (raw.get("kinematics") or {}).get("joint_limits_rad")
    if reported is None or np.shape(reported) != arm.limits_rad.shape:
        return []
    cells, theirs = np.degrees(arm.limits_rad), np.degrees(reported)
    slack = np.degrees(_LIMIT_RAD)
    narrower = (theirs[:, 0] > cells[:, 0] + slack) | (theirs[:, 1] < cells[:, 1] - slack)
    return [
        f"joint {joint + 1} may turn from {cells[joint, 0]:g} to {cells[joint, 1]:g}° by the cell"
        f" file, from {theirs[joint, 0]:g} to {theirs[joint, 1]:g}° by the controller: narrow"
        f" `joint_limits_deg.joint_{joint + 1}` and plan anew, or widen it at the pendant"
        for joint in np.flatnonzero(narrower)
    ]


def _pose(flange_from_tcp: RigidTransform) -> str:
    x, y, z = 1e3 * flange_from_tcp.translation
    turn_deg = np.degrees(flange_from_tcp.rotation.magnitude())
    return f"{x:.1f} {y:.1f} {z:.1f} mm and {turn_deg:.1f}° from the flange"
