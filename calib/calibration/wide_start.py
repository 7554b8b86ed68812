"""Where the fit of a wide lens begins: no homography holds over such pictures.

In an equidistant image a direction's angle off the axis is its distance from the middle over the
focal length. With the principal point in the picture's middle the focal length alone is left to
be found: for each of a few, every frame's corners are brought to a plane square to their own middle
direction, the homography there gives the pose, and the focal length under which the pictures agree
best is taken.
"""

from __future__ import annotations

import numpy as np

from calib.calibration.frames import CORNERS_NEEDED
from calib.chain import rigid
from calib.chain.domain import off_axis_rad
from calib.chain.optics import COLUMN, optics_row
from calib.chain.projection import project
from calib.chain.sight import unproject
from calib.errors import CalibrationError
from calib.paper.extrinsics import board_poses
from calib.paper.homography import robust_homographies
from calib.views import BoolArray, FloatArray, Views

_HALF_DIAGONALS_RAD = np.radians(np.arange(40.0, 131.0, 7.5))
"""Angles at which the picture's farthest corner may lie."""

_FLAT_RAD = np.radians(65.0)
"""Beyond, off a frame's own middle, the plane makes of a pixel's noise many times what it is."""


def wide_start(views: Views, wanted: BoolArray) -> tuple[FloatArray, FloatArray]:
    """An equidistant lens, and each frame's pose under it, near enough for the iteration.

    Parameters
    ----------
    views, wanted:
        The views, and (N,) which of them.

    Returns
    -------
    (K,) optics; (N, 4, 4) camera_from_board, NaN for a frame that none could be found for.

    Raises
    ------
    CalibrationError
        Under no focal length do the pictures show the board.
    """
    best: tuple[float, FloatArray, FloatArray] | None = None
    for half in _HALF_DIAGONALS_RAD:
        row = _lens(views, float(half))
        poses = wide_poses(row, views, wanted)
        known = np.isfinite(poses).all(axis=(1, 2))
        if not known.any() or 2 * known.sum() < wanted.sum():
            continue
        rows = np.tile(row, (int(known.sum()), 1))
        predicted = project(rows, poses[known], views.board.corners_m)
        off = np.linalg.norm(views.corners_px[known] - predicted, axis=2)
        typical = float(np.nanmean(np.nanmedian(off, axis=1)))
        if best is None or typical < best[0]:
            best = (typical, row, poses)
    if best is None:
        raise CalibrationError("no wide lens shows the board as these pictures do")
    return best[1], best[2]


def _lens(views: Views, half_diagonal_rad: float) -> FloatArray:
    focal = np.hypot(views.width_px, views.height_px) / 2 / half_diagonal_rad
    return optics_row(
        alpha_px=focal,
        beta_px=focal,
        u0_px=(views.width_px - 1) / 2,
        v0_px=(views.height_px - 1) / 2,
        height_px=views.height_px,
        equidistant=1.0,
    )


def wide_poses(row: FloatArray, views: Views, wanted: BoolArray) -> FloatArray:
    """(N, 4, 4) camera_from_board by homographies; NaN where none is.

    Each frame's in a plane square to the line of sight to the middle of its corners, wherever in
    the picture that is.
    """
    corners = views.corners_px
    sight = unproject(row, np.nan_to_num(corners).reshape(-1, 2)).reshape(*corners.shape[:2], 3)
    sight[~(views.seen & wanted[:, None])] = np.nan
    known = np.isfinite(sight).all(axis=2).sum(axis=1) >= CORNERS_NEEDED
    poses = np.full((len(views), 4, 4), np.nan)
    if not known.any():
        return poses
    from_ahead = rigid.turn_from_axis(np.nanmean(sight[known], axis=1))
    turned = sight[known] @ from_ahead[:, :3, :3]
    with np.errstate(invalid="ignore", divide="ignore"):
        near = off_axis_rad(turned) < _FLAT_RAD
        flat = np.where(near[..., None], turned[..., :2] / turned[..., 2:], np.nan)
    focal = float(row[COLUMN["alpha_px"]])
    homographies, _, _ = robust_homographies(views.board.corners_m[:, :2], focal * flat)
    found = np.isfinite(homographies).all(axis=(1, 2))
    seen = board_poses(homographies[found], np.diag([focal, focal, 1.0]))
    poses[np.flatnonzero(known)[found]] = rigid.product(from_ahead[found], seen)
    return poses
