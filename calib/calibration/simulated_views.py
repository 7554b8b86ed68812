"""Made-up views, for asking a fitted cell what it would see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.model import CellModel
from calib.chain.rigid import inverse
from calib.views import Board, FloatArray, Views


def views_that_see(
    model: CellModel,
    views: Views,
    board: Board,
    camera_from_board: FloatArray,
    focus_distance_m: float = np.nan,
) -> Views:
    """Views without corners at the flange poses from which the cell sees a board so.

    Parameters
    ----------
    model, views:
        The cell, and views whose image size and mount are taken.
    board, camera_from_board:
        What is seen, and (N, 4, 4) where.
    focus_distance_m:
        Logged focus of all views; the board's own distance counts where it is not given.
    """
    n = len(camera_from_board)
    blank = Views.blank(
        board, width_px=views.width_px, height_px=views.height_px, frames=n, mount=views.mount
    )
    loop = inverse(camera_from_board) if views.mount == "eye_in_hand" else camera_from_board
    flange = model.base_from_fixed @ loop @ inverse(model.flange_from_mounted)
    return replace(blank, base_from_flange=flange, focus_distance_m=np.full(n, focus_distance_m))
