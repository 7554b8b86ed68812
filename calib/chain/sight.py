"""Lines of sight: from pixels back to directions, and where that can be done at all.

A lens's radial distortion holds as long as it grows outwards. Where it folds, two directions share
a pixel, and no pixel beyond belongs to any: there, and behind a perspective camera, the answer is
NaN and no number.
"""

from __future__ import annotations

import numpy as np

from calib.chain.domain import distorted_radius, invertible_rad, off_axis_rad
from calib.chain.optics import COLUMN
from calib.chain.projection import project as project_anything
from calib.chain.projection import project_with_jacobians
from calib.views import BoolArray, FloatArray

_STEPS = 600
_BACK_INSIDE = 0.98
"""Of the domain: where a line of sight starts, or goes on, that the lens's edge would throw out.
From inside Newton's method nears a direction at the edge step by step; from the edge itself, where
nothing grows, it leaps across the fold."""
_ITERATIONS = 30
_SETTLED_RAD = 1e-12
_CENTRAL = ("pupil_m_rad2", "window_m", *(n for n in COLUMN if n.startswith("sweep")))
"""What moves a line of sight sideways or with the board: a direction alone has none of it."""


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
            sight = _inside(sight / np.linalg.norm(sight, axis=1, keepdims=True), widest)
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
    """(Q, 3) directions by the radial distortion alone; those beyond the domain near its edge."""
    alpha, beta, skew, u0, v0 = row[:5]
    y = (pixels_px[:, 1] - v0) / beta
    x = (pixels_px[:, 0] - u0 - skew * y) / alpha
    angles = np.linspace(0.0, widest_rad * (1.0 - 1e-9), _STEPS)
    angle = np.interp(np.hypot(x, y), distorted_radius(row, angles), angles)
    return _ray(np.minimum(angle, _BACK_INSIDE * widest_rad), np.arctan2(y, x))


def _inside(sight: FloatArray, widest_rad: float) -> FloatArray:
    """(Q, 3) the same directions, those that left the domain put back."""
    beyond = off_axis_rad(sight) > widest_rad
    around = np.arctan2(sight[:, 1], sight[:, 0])
    return np.where(
        beyond[:, None], _ray(np.full(len(sight), _BACK_INSIDE * widest_rad), around), sight
    )


def _ray(angle_rad: FloatArray, around_rad: FloatArray) -> FloatArray:
    """(Q, 3) directions that far off the axis."""
    aside = np.stack([np.cos(around_rad), np.sin(around_rad)], axis=1)
    return np.column_stack([np.sin(angle_rad)[:, None] * aside, np.cos(angle_rad)])
