"""Closed-form inverse of the Universal Robots geometry: three parallel axes, offset wrist.

Source: K. P. Hawkins, "Analytic Inverse Kinematics for the Universal Robots UR-5/UR-10 Arms",
Georgia Tech 2013; derived anew here for standard DH rows with signed lengths.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from calib.chain.kinematics.dh import link_transforms
from calib.views import FloatArray

_SINGULAR = 1e-9


def ur_branches(dh: FloatArray, base_from_flange: FloatArray, near_rad: FloatArray) -> FloatArray:
    """Up to eight branches (B, 6), whole turns not yet resolved.

    Where joints 2, 3, 4 and 6 are parallel, joint 6 is free and takes that of `near_rad`.
    """
    found = [
        _solve(dh, base_from_flange, (shoulder, wrist, elbow), float(near_rad[5]))
        for shoulder, wrist, elbow in product((1.0, -1.0), repeat=3)
    ]
    return np.array([joints for joints in found if joints is not None]).reshape(-1, 6)


def _solve(
    dh: FloatArray, pose: FloatArray, signs: tuple[float, float, float], free_wrist_rad: float
) -> FloatArray | None:
    shoulder, wrist, elbow = signs
    q1 = _shoulder_pan(dh, pose, shoulder)
    if q1 is None:
        return None
    bent = _wrist(dh, pose, q1, wrist, free_wrist_rad)
    if bent is None:
        return None
    q5, q6 = bent
    lift = _planar(dh, pose, (q1, q5, q6), elbow)
    return None if lift is None else np.array([q1, *lift, q5, q6])


def _shoulder_pan(dh: FloatArray, pose: FloatArray, sign: float) -> float | None:
    d4, d6 = dh[3, 1], dh[5, 1]
    x, y = pose[:2, 3] - d6 * pose[:2, 2]
    radius = np.hypot(x, y)
    if radius < abs(d4):
        return None
    return float(np.arctan2(y, x) + sign * np.arccos(d4 / radius) + np.pi / 2)


def _wrist(
    dh: FloatArray, pose: FloatArray, q1: float, sign: float, free_wrist_rad: float
) -> tuple[float, float] | None:
    d4, d6 = dh[3, 1], dh[5, 1]
    across = np.array([np.sin(q1), -np.cos(q1), 0.0])
    cosine = (across @ pose[:3, 3] - d4) / d6
    if abs(cosine) > 1 + _SINGULAR:
        return None
    q5 = sign * float(np.arccos(np.clip(cosine, -1, 1)))
    sine = np.sin(q5)
    if abs(sine) < _SINGULAR:
        return q5, free_wrist_rad
    q6 = np.arctan2(-(across @ pose[:3, 1]) / sine, (across @ pose[:3, 0]) / sine)
    return q5, float(q6)


def _planar(
    dh: FloatArray, pose: FloatArray, q156: tuple[float, float, float], sign: float
) -> tuple[float, float, float] | None:
    """Joints 2, 3 and 4: two links in the plane, and the rest of the turn."""
    a2, a3 = dh[1, 2], dh[2, 2]
    q1, q5, q6 = q156
    links = link_transforms(np.array([q1, 0.0, 0.0, 0.0, q5, q6]), dh)
    shoulder_from_wrist = np.linalg.inv(links[0]) @ pose @ np.linalg.inv(links[4] @ links[5])
    x, y = shoulder_from_wrist[:2, 3]
    cosine = (x * x + y * y - a2 * a2 - a3 * a3) / (2 * a2 * a3)
    if abs(cosine) > 1 + _SINGULAR:
        return None
    q3 = sign * float(np.arccos(np.clip(cosine, -1, 1)))
    q2 = np.arctan2(y, x) - np.arctan2(a3 * np.sin(q3), a2 + a3 * np.cos(q3))
    q234 = np.arctan2(shoulder_from_wrist[1, 0], shoulder_from_wrist[0, 0])
    return float(q2), q3, float(q234 - q2 - q3)
