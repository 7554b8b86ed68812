"""Whether joints and pose can be those of an arm at all; whoever says so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_UNIT_WITHIN = 1e-3
_FARTHEST_MM = 1e5  # with the base anywhere in a hall
_BEYOND_LIMITS_RAD = 0.1


def implausible(
    joints_deg: Sequence[float],
    mm: Sequence[float],
    wxyz: Sequence[float],
    limits_rad: Sequence[tuple[float, float]],
) -> str | None:
    """Return what is wrong with a reading, or None.

    Parameters
    ----------
    joints_deg:
        Six joint angles, degrees.
    mm, wxyz:
        Position, millimetres, and quaternion, scalar first, of a pose.
    limits_rad:
        Lowest and highest angle of each joint, radians.
    """
    if (len(joints_deg), len(mm), len(wxyz)) != (6, 3, 4):
        return "it does not have six joints and a pose"
    for name, values in (("joint angle", joints_deg), ("position", mm), ("quaternion", wxyz)):
        if not np.isfinite(values).all():
            return f"a {name} is not finite"
    if abs(float(np.linalg.norm(wxyz)) - 1.0) > _UNIT_WITHIN:
        return "its quaternion does not have length 1"
    if float(np.abs(mm).max()) > _FARTHEST_MM:
        return f"its position lies more than {_FARTHEST_MM / 1000:g} m away"
    return _outside(np.radians(joints_deg).tolist(), limits_rad)


def _outside(joints_rad: list[float], limits_rad: Sequence[tuple[float, float]]) -> str | None:
    for number, (angle, (low, high)) in enumerate(zip(joints_rad, limits_rad, strict=True), 1):
        if not low - _BEYOND_LIMITS_RAD <= angle <= high + _BEYOND_LIMITS_RAD:
            return f"joint {number} stands at {angle:.3g} rad, outside its working range"
    return None
