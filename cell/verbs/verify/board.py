"""About where the board is in new pictures, by the old camera: it may have been moved since."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.model import evaluate
from calib.chain.optics import COLUMN
from calib.chain.rigid import inverse, to_vector
from calib.detection.orientation import turned_order
from calib.errors import CalibrationError
from calib.paper.extrinsics import board_poses
from calib.paper.homography import fit_homography
from calib.views import FloatArray, Views
from cell.verbs.verify.old_cell import OldCell

_CORNERS_NEEDED = 8


def board_now(old: OldCell, views: Views) -> tuple[FloatArray, Views]:
    """(4, 4) where most frames have the board, and the views that count.

    The place is `base_from_board`, or `flange_from_board` with a fixed camera. Frames without
    a pose or with too few corners are left out. Where the corners' names could be turned (a board
    that looks the same from both ends) they are turned to where the old calibration had it.

    Raises
    ------
    CalibrationError
        No frame can be used.
    """
    views, camera_from_board = _located(old, views)
    places = _places(old, views, camera_from_board)
    shift = to_vector(inverse(places)[:, None] @ places[None])
    size = float(np.ptp(views.board.corners_m[:, :2], axis=0).max())
    off = np.linalg.norm(shift[..., :3], axis=2) + size * np.linalg.norm(shift[..., 3:], axis=2)
    middle = places[int(np.median(off, axis=1).argmin())]
    turn = _turn(old, views, middle)
    if turn == 0:
        return middle, views
    order = turned_order(views.board, turn)
    turned = replace(
        views,
        corners_px=views.corners_px[:, order],
        corner_sigma_px=views.corner_sigma_px[:, order],
    )
    return board_now(old, turned)


def _located(old: OldCell, views: Views) -> tuple[Views, FloatArray]:
    chosen, homographies = [], []
    for index in np.flatnonzero(views.has_pose & (views.seen.sum(axis=1) >= _CORNERS_NEEDED)):
        try:
            fit = fit_homography(views.board.corners_m[:, :2], views.corners_px[index])
        except CalibrationError:
            continue
        chosen.append(int(index))
        homographies.append(fit.matrix)
    if not chosen:
        raise CalibrationError("no frame has both a flange pose and the board in its picture")
    return views.take(np.array(chosen)), board_poses(np.array(homographies), _matrix(old, views))


def _matrix(old: OldCell, views: Views) -> FloatArray:
    """(3, 3) of the old camera, focused in the middle of its range."""
    ahead = np.eye(4)
    ahead[2, 3] = float(np.sqrt(np.prod(old.range_m)))
    blank = Views.blank(
        views.board, width_px=views.width_px, height_px=views.height_px, frames=1, mount=views.mount
    )
    blank = replace(
        blank, base_from_flange=np.eye(4)[None], focus_distance_m=np.array([ahead[2, 3]])
    )
    row = evaluate(old.model, blank).optics[0]
    alpha, beta, skew, u0, v0 = (
        row[COLUMN[name]] for name in ("alpha_px", "beta_px", "skew_px", "u0_px", "v0_px")
    )
    return np.array([[alpha, skew, u0], [0.0, beta, v0], [0.0, 0.0, 1.0]])


def _places(old: OldCell, views: Views, camera_from_board: FloatArray) -> FloatArray:
    flange = views.base_from_flange
    if old.mount == "eye_in_hand":
        return flange @ old.model.flange_from_mounted @ camera_from_board
    return inverse(flange) @ old.model.base_from_fixed @ camera_from_board


def board_before(old: OldCell) -> FloatArray:
    """(4, 4) where the old calibration had the board."""
    held = old.mount == "eye_in_hand"
    return old.model.base_from_fixed if held else old.model.flange_from_mounted


def _turn(old: OldCell, views: Views, place: FloatArray) -> int:
    """Half a turn where the board's names allow it and bring it nearer to its old place."""
    board = views.board
    if board.identified or (board.rows + board.cols) % 2:
        return 0
    half = np.diag([-1.0, -1.0, 1.0, 1.0])
    half[:2, 3] = board.corners_m[-1, :2]
    before = board_before(old)
    away = [np.linalg.norm((place @ t)[:3, :2] - before[:3, :2]) for t in (np.eye(4), half)]
    return 0 if away[0] <= away[1] else 2
