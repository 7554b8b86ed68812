"""Where a lens's image can be inverted: up to the angle at which its radial distortion folds.

By itself, without what is compiled for the projection: an export asks for nothing else.
"""

from __future__ import annotations

import numpy as np

from calib.chain.optics import COLUMN
from calib.views import FloatArray

_WIDEST_PERSPECTIVE_RAD = np.radians(89.9)
_STEPS = 600


def distorted_radius(optics: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """(Q,) distance from the principal point, in focal lengths, of directions off the axis.

    By the radial distortion alone; negative or huge where that has lost its sense.
    """
    k1, k2, k3, k4, k5, k6 = (optics[COLUMN[f"k{i}"]] for i in range(1, 7))
    value = np.polynomial.polynomial.polyval
    if optics[COLUMN["equidistant"]]:
        return np.asarray(angle_rad * value(angle_rad**2, (1.0, k1, k2, k3, k4)))
    r = np.tan(angle_rad)
    below = value(r**2, (1.0, k4, k5, k6))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(below > 0, r * value(r**2, (1.0, k1, k2, k3)) / below, -np.inf)


def invertible_rad(optics: FloatArray) -> float:
    """Angle off the axis up to which (K,) optics give every direction a pixel of its own.

    Where the radial distortion never folds: just short of a right angle for a perspective camera,
    half a turn for an equidistant one. The small terms that are not radial are not looked at.
    """
    angle = np.linspace(0.0, _widest_rad(optics), _STEPS)
    for _ in range(3):  # each time between the two steps where it folds
        with np.errstate(invalid="ignore"):  # beyond a pole
            grows = np.diff(distorted_radius(optics, angle)) > 0
        if grows.all():
            return float(angle[-1])
        fold = int((~grows).argmax())
        angle = np.linspace(angle[max(fold - 1, 0)], angle[fold + 1], _STEPS)
    return float(angle[fold])


def _widest_rad(optics: FloatArray) -> float:
    return float(np.pi if optics[COLUMN["equidistant"]] else _WIDEST_PERSPECTIVE_RAD)


def off_axis_rad(points_m: FloatArray) -> FloatArray:
    """(...) angles of (..., 3) points in the camera's frame with its axis."""
    aside = np.hypot(points_m[..., 0], points_m[..., 1])
    return np.asarray(np.arctan2(aside, points_m[..., 2]))
