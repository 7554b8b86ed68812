"""Closed-form inverse of an elbow arm whose last three axes meet in one point."""

from __future__ import annotations

from itertools import product

import numpy as np

from calib.chain.kinematics.dh import link_transforms
from calib.views import FloatArray

_SINGULAR = 1e-9


def spherical_wrist_branches(
    dh: FloatArray, base_from_flange: FloatArray, near_rad: FloatArray
) -> FloatArray:
    """Up to eight branches (B, 6), whole turns not yet resolved.

    For rows of the form alpha = (-90, 0, -90, 90, -90, 0) degrees with lengths d1, a1, a2, a3,
    d4, d6: the wrist's centre gives joints 1 to 3, the turn left over gives a ZYZ wrist
    (Siciliano et al., Robotics, section 2.12.5). Where joints 4 and 6 are in line, joint 6
    takes that of `near_rad`.
    """
    centre = base_from_flange[:3, 3] - dh[5, 1] * base_from_flange[:3, 2]
    found = []
    for front, elbow, flip in product((True, False), (1.0, -1.0), (1.0, -1.0)):
        arm = _first_three(dh, centre, front, elbow)
        if arm is not None:
            found.append([*arm, *_wrist(dh, base_from_flange, arm, flip, float(near_rad[5]))])
    return np.array(found).reshape(-1, 6)


def _first_three(
    dh: FloatArray, centre: FloatArray, front: bool, elbow: float
) -> tuple[float, float, float] | None:
    pan = np.arctan2(centre[1], centre[0]) + (0.0 if front else np.pi)
    out = np.cos(pan) * centre[0] + np.sin(pan) * centre[1] - dh[0, 2]
    up = centre[2] - dh[0, 1]
    upper, fore = dh[1, 2], np.hypot(dh[2, 2], dh[3, 1])
    cosine = (out * out + up * up - upper * upper - fore * fore) / (2 * upper * fore)
    if abs(cosine) > 1 + _SINGULAR:
        return None
    # Angles in the frame of link 1, whose y axis points down.
    bend = elbow * np.arccos(np.clip(cosine, -1, 1))
    lift = np.arctan2(-up, out) - np.arctan2(fore * np.sin(bend), upper + fore * np.cos(bend))
    offset = np.arctan2(dh[3, 1], dh[2, 2])
    return (
        float(pan - dh[0, 0]),
        float(lift - dh[1, 0]),
        float(bend - offset - dh[2, 0]),
    )


def _wrist(
    dh: FloatArray,
    pose: FloatArray,
    arm: tuple[float, float, float],
    flip: float,
    free_wrist_rad: float,
) -> tuple[float, float, float]:
    links = link_transforms(np.array([*arm, 0.0, 0.0, 0.0]), dh)
    turn = (links[0] @ links[1] @ links[2])[:3, :3].T @ pose[:3, :3]
    sine = np.hypot(turn[0, 2], turn[1, 2])
    if sine < _SINGULAR:
        return _wrist_in_line(dh, turn, free_wrist_rad)
    # turn = Rz(t4) Rx(90) Rz(t5) Rx(-90) Rz(t6) = Rz(t4) Ry(-t5) Rz(t6)
    t4 = np.arctan2(-flip * turn[1, 2], -flip * turn[0, 2])
    t5 = np.arctan2(flip * sine, turn[2, 2])
    t6 = np.arctan2(-flip * turn[2, 1], flip * turn[2, 0])
    return float(t4 - dh[3, 0]), float(t5 - dh[4, 0]), float(t6 - dh[5, 0])


def _wrist_in_line(
    dh: FloatArray, turn: FloatArray, free_wrist_rad: float
) -> tuple[float, float, float]:
    t5 = 0.0 if turn[2, 2] > 0 else np.pi
    t6 = free_wrist_rad + dh[5, 0]
    total = np.arctan2(turn[1, 0], turn[0, 0])
    # With t5 = pi the two turns oppose: turn[:2, 0] = -(cos, sin)(t4 - t6).
    t4 = total - t6 if t5 == 0.0 else total + np.pi + t6
    return float(t4 - dh[3, 0]), float(t5 - dh[4, 0]), free_wrist_rad
