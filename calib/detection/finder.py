"""Finds a chessboard in a picture: coarse levels first, then the fit on the full picture."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calib.detection.candidates import find_candidates
from calib.detection.grid import Grid, in_board_order, place_board, with_predictions
from calib.detection.lattice import grow_lattices
from calib.detection.refine import Fitted, doubtful, enlarged, fit_closely, fit_grid, starts
from calib.detection.result import Rejected
from calib.detection.saddle import X, Y
from calib.detection.scales import FloatImage, scaled, scales
from calib.views import Board

_MOST_PIECES = 3
_PARTIAL = "partial view"
_NOTHING = "no chessboard corners in the picture"
# a fit at this scale finds the shading and the bend of the lines well enough
_GOOD_ENOUGH_SCALE = 0.5


def _filled(image: FloatImage, grid: Grid) -> tuple[Fitted, int]:
    """The grid fitted on the level's image with its gaps filled, and how many corners are there."""
    filled = with_predictions(grid)
    fitted = fit_grid(image, starts(image, filled.corners_px))
    return fitted, int((~doubtful(fitted, filled.corners_px, grid.first_dark)).sum())


def _on_level(image: FloatImage, board: Board) -> tuple[Grid, Fitted] | Rejected:
    reasons, most = [Rejected(_NOTHING)], 0
    for lattice in grow_lattices(find_candidates(image))[:_MOST_PIECES]:
        placed = place_board(lattice, board)
        if isinstance(placed, Rejected):
            reasons.append(placed)
            continue
        for grid in (in_board_order(grid, board) for grid in placed):
            fitted, seen = _filled(image, grid)
            if seen == board.corner_count:
                return grid, fitted
            most = max(most, seen)
    if most:
        return Rejected(
            f"{_PARTIAL}: {most} of {board.corner_count} corners are clear, the others lie "
            "outside the picture, are covered or burnt out"
        )
    return reasons[1] if len(reasons) > 1 else reasons[0]


def _found(image: FloatImage, board: Board) -> Iterator[tuple[float, Grid, Fitted] | Rejected]:
    for scale in scales(image.shape):
        found = _on_level(scaled(image, scale), board)
        yield found if isinstance(found, Rejected) else (scale, *found)


def find_chessboard(image: FloatImage, board: Board) -> tuple[Fitted, NDArray[np.bool_]] | Rejected:
    """All inner corners of a chessboard (none unseen), or why they were not found.

    Parameters
    ----------
    image:
        (h, w) grey levels.
    board:
        What to look for.
    """
    best: Rejected | None = None
    for found in _found(image, board):
        if isinstance(found, Rejected):
            best = _more_specific(best, found)
            continue
        scale, grid, coarse = found
        first = enlarged(coarse.parameters, scale)
        fine = fit_closely(image, first, rough=scale < _GOOD_ENOUGH_SCALE)
        doubt = doubtful(fine, first[..., [X, Y]], grid.first_dark)
        if doubt.any():
            best = Rejected(
                f"{int(doubt.sum())} of {doubt.size} corners are unclear when looked at closely"
            )
            continue
        return fine, doubt
    return Rejected("the picture is too small") if best is None else best


def _more_specific(before: Rejected | None, now: Rejected) -> Rejected:
    """Of two scales' reasons the one that saw more of a board."""
    if before is None or _PARTIAL in now.reason or before.reason == _NOTHING:
        return now
    return before
