"""Finds a chessboard in a picture: coarse levels first, then the fit on the full picture."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.candidates import find_candidates
from calib.detection.grid import Grid, in_board_order, place_board, with_predictions
from calib.detection.lattice import grow_lattices
from calib.detection.refine import Fitted, doubtful, fit_closely, fit_grid, starts
from calib.detection.result import FloatArray, Rejected
from calib.detection.saddle import PIXEL_VARIANCE, WIDTH, X, Y
from calib.views import Board

FloatImage = NDArray[np.float32]

_FIRST_LEVEL_PIXELS = 0.4e6
_SMALLEST_SIDE_PX = 100
_MOST_PIECES = 3
_PARTIAL = "partial view"
_NOTHING = "no chessboard corners in the picture"
# a fit at this scale tells the shading and the bend of the lines well enough
_GOOD_ENOUGH_SCALE = 0.5


def _scales(shape: tuple[int, ...]) -> list[float]:
    """Image scales in the order in which they are tried."""
    first = 0
    while shape[0] * shape[1] * 0.25**first > _FIRST_LEVEL_PIXELS:
        first += 1
    coarser = [s for s in (first + 1, first + 2) if min(shape[:2]) * 0.5**s >= _SMALLEST_SIDE_PX]
    return [0.5**s for s in (first, *range(first - 1, -1, -1), *coarser)]


def _scaled(image: FloatImage, scale: float) -> FloatImage:
    if scale == 1.0:
        return image
    factor = round(1 / scale)
    height, width = (side // factor for side in image.shape)
    whole = image[: height * factor, : width * factor]
    return np.asarray(
        cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), dtype=np.float32
    )


def _enlarged(first: FloatArray, scale: float) -> FloatArray:
    """Fit parameters of a smaller image, as starts on the full one."""
    starts_full = first.copy()
    starts_full[..., [X, Y]] = (first[..., [X, Y]] + 0.5) / scale - 0.5
    blur2 = np.maximum(first[..., WIDTH] ** 2 - PIXEL_VARIANCE, 0.05) / scale**2
    starts_full[..., WIDTH] = np.sqrt(blur2 + PIXEL_VARIANCE)
    return starts_full


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
    for scale in _scales(image.shape):
        found = _on_level(_scaled(image, scale), board)
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
            best = _more_telling(best, found)
            continue
        scale, grid, coarse = found
        first = _enlarged(coarse.parameters, scale)
        fine = fit_closely(image, first, rough=scale < _GOOD_ENOUGH_SCALE)
        doubt = doubtful(fine, first[..., [X, Y]], grid.first_dark)
        if doubt.any():
            best = Rejected(
                f"{int(doubt.sum())} of {doubt.size} corners are unclear when looked at closely"
            )
            continue
        return fine, doubt
    return Rejected("the picture is too small") if best is None else best


def _more_telling(before: Rejected | None, now: Rejected) -> Rejected:
    """Of two scales' reasons the one that saw more of a board."""
    if before is None or _PARTIAL in now.reason or before.reason == _NOTHING:
        return now
    return before
