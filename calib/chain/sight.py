"""Lines of sight: from pixels back to directions, and where that can be done at all.

A lens's radial distortion holds as long as it grows outwards. Where it folds, two directions share
a pixel, and no pixel beyond belongs to any: there, and behind a perspective camera, the answer is
NaN and no number.
"""

from __future__ import annotations

import numpy as np

from calib.chain.optics import COLUMN
from calib.chain.projection import project as project_anything
from calib.chain.projection import project_with_jacobians
from calib.views import BoolArray, FloatArray

_WIDEST_PERSPECTIVE_RAD = np.radians(89.9)
_STEPS = 600
_ITERATIONS = 30
_SETTLED_RAD = 1e-12
_CENTRAL = ("pupil_m_rad2", "window_m", *(n for n in COLUMN if n.startswith("sweep")))
"""What moves a line of sight sideways or with the board: a direction alone has none of it."""


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


def project(optics: FloatArray, camera_from_board: FloatArray, points_m: FloatArray) -> FloatArray:
    """Project M points in N frames, those outside the lens's domain as NaN.

    Parameters
    ----------
    optics:
        (N, K) columns of `OPTICS`.
    camera_from_board:
        (N, 4, 4).
    points_m:
        (M, 3) in the board's frame, metres.

    Returns
    -------
    (N, M, 2) pixels, (0, 0) at the centre of the top-left pixel; NaN for a point farther off the
    axis than `invertible_rad`. They may lie outside the picture.
    """
    pixels = project_anything(optics, camera_from_board, points_m)
    rotation, shift = camera_from_board[:, None, :3, :3], camera_from_board[:, None, :3, 3]
    inside = in_domain(optics, (rotation @ points_m[..., None])[..., 0] + shift)
    return np.where(inside[..., None], pixels, np.nan)


def in_domain(optics: FloatArray, points_m: FloatArray) -> BoolArray:
    """(N, M) whether (N, M, 3) points in the camera's frame have a pixel by (N, K) optics."""
    rows, which = np.unique(optics, axis=0, return_inverse=True)
    widest = np.array([invertible_rad(row) for row in rows])[which.reshape(-1)]
    return np.asarray(off_axis_rad(points_m) <= widest[:, None])


def unproject(optics: FloatArray, pixels_px: FloatArray) -> FloatArray:
    """Directions in which a camera sees pixels.

    Parameters
    ----------
    optics:
        (K,) one frame's columns of `OPTICS`; pupil shift, window and sweep are not looked at,
        since no direction alone follows from them.
    pixels_px:
        (Q, 2), (0, 0) at the centre of the top-left pixel.

    Returns
    -------
    (Q, 3) unit vectors in the camera's frame; NaN for a pixel that no direction inside the lens's
    domain is seen at.
    """
    row = optics.copy()
    row[[COLUMN[name] for name in _CENTRAL]] = 0.0
    widest = invertible_rad(row)
    sight = _radially(row, pixels_px, widest)
    settled = np.zeros(len(sight), dtype=bool)
    for _ in range(_ITERATIONS):
        seen, j_pose, _ = project_with_jacobians(row[None], np.eye(4)[None], sight)
        by_sight, miss = j_pose[0, :, :, :3], pixels_px - seen[0]
        with np.errstate(invalid="ignore", over="ignore"):
            step = np.einsum("qji,qj->qi", by_sight, _solved(by_sight, miss))
            length = np.linalg.norm(step, axis=1)
            step *= np.minimum(1.0, 0.2 / np.maximum(length, 1e-300))[:, None]
            sight += step
            sight /= np.linalg.norm(sight, axis=1, keepdims=True)
        settled = length < _SETTLED_RAD
        if settled.all():
            break
    settled |= np.abs(miss).max(axis=1) < 1e-9
    with np.errstate(invalid="ignore"):
        inside = settled & (off_axis_rad(sight) <= widest)
    return np.where(inside[:, None], sight, np.nan)


def _solved(by_sight: FloatArray, miss: FloatArray) -> FloatArray:
    """(Q, 2) x with J Jᵀ x = miss, so that Jᵀ x is the shortest step that mends it."""
    gram = by_sight @ np.swapaxes(by_sight, 1, 2)
    det = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    det = np.where(det > 0, det, np.nan)
    return np.stack(
        [
            (gram[:, 1, 1] * miss[:, 0] - gram[:, 0, 1] * miss[:, 1]) / det,
            (gram[:, 0, 0] * miss[:, 1] - gram[:, 0, 1] * miss[:, 0]) / det,
        ],
        axis=1,
    )


def _radially(row: FloatArray, pixels_px: FloatArray, widest_rad: float) -> FloatArray:
    """(Q, 3) directions by the radial distortion alone; those beyond the domain at its edge."""
    alpha, beta, skew, u0, v0 = row[:5]
    y = (pixels_px[:, 1] - v0) / beta
    x = (pixels_px[:, 0] - u0 - skew * y) / alpha
    angles = np.linspace(0.0, widest_rad * (1.0 - 1e-9), _STEPS)
    angle = np.interp(np.hypot(x, y), distorted_radius(row, angles), angles)
    around = np.arctan2(y, x)
    aside = np.sin(angle)[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    return np.column_stack([aside, np.cos(angle)])
