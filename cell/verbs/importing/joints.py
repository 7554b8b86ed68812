"""Joint angles of another tool as poses of the flange, through the arm's kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.chain.kinematics import MODELS, UnknownArm, arm
from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing.raw import Series

_UR_ORDER = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_TURN_RAD = 2 * np.pi + 0.01


def as_poses(series: Series, robot: str | None) -> list[Series]:
    """The flange's poses for every unit the angles can have: radians, degrees.

    Raises
    ------
    InputError
        The arm is not stated or not known, or they are not six angles a row.
    """
    where = series.poses[0].where
    if robot is None:
        raise InputError(
            f"{where}: these are joint angles. Say --robot MODEL ({', '.join(sorted(MODELS))}), and"
            " the arm's kinematics make them poses"
        )
    try:
        kinematics = arm(robot)
    except UnknownArm as fault:
        raise InputError(f"--robot {robot}: {fault}") from None
    angles = in_order(series)
    found = []
    for unit, angles_rad in _readings(angles):
        poses = kinematics.forward(angles_rad).reshape(-1, 16)
        made = tuple(
            replace(p, values=v, rotations=("matrix",), unit="m")
            for p, v in zip(series.poses, poses, strict=True)
        )
        note = f"poses are made of joint angles in {unit} by the kinematics of {robot}"
        found.append(replace(series, role="flange", poses=made, notes=(*series.notes, note)))
    return found


def in_order(series: Series) -> FloatArray:
    """(N, 6) angles from the base to the flange, whatever order their names are in."""
    if any(len(pose.values) != 6 for pose in series.poses):
        raise InputError(f"{series.poses[0].where}: joint angles must be six a row")
    angles = series.values
    places = [
        next((k for k, name in enumerate(series.joint_names) if word in name.lower()), None)
        for word in _UR_ORDER
    ]
    if None in places:
        return angles
    return np.asarray(angles[:, [int(k) for k in places if k is not None]])


def radians(angles: FloatArray) -> FloatArray | None:
    """The angles in radians where their size states the unit, else None."""
    readings = _readings(angles)
    return readings[0][1] if len(readings) == 1 else None


def _readings(angles: FloatArray) -> Sequence[tuple[str, FloatArray]]:
    if np.abs(angles).max() > _TURN_RAD:
        return [("degrees", np.radians(angles))]
    if np.abs(angles).max() > np.radians(30):  # a whole series within 6 degrees is no degrees
        return [("radians", angles)]
    return [("radians", angles), ("degrees", np.radians(angles))]
