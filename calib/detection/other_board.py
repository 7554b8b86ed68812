"""Whether the markers that were read belong to another board than the one described.

The likeness of blurred markers would still place a described board somewhere on a larger one, or
on one whose markers are numbered otherwise, and name its corners wrongly. Each marker is compared
with its nearest neighbours in its own measure, so that neither perspective nor a lens that bends
the board as a whole matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.detection.result import FloatArray
from calib.views import Board

# markers are misread now and then, and a scene may hold one that is no part of any board
_FEWEST = 4
_FEWEST_BEYOND = 2
_AGREES_SQUARES = 0.3
_NEAR_SQUARES = 2.5


def other_board(
    layouts: Sequence[Any], marker_corners: Sequence[Any], marker_ids: Any, board: Board
) -> str | None:
    """Why the markers read are those of another board, with what was seen, or None.

    Parameters
    ----------
    layouts:
        OpenCV's descriptions of the board, old and new.
    marker_corners, marker_ids:
        As OpenCV's detector gives them.
    """
    if marker_ids is None or len(marker_ids) < _FEWEST:
        return None
    ids = np.asarray(marker_ids).ravel()
    corners = np.array([c.reshape(4, 2) for c in marker_corners], dtype=float)
    own = np.isin(ids, layouts[0].getIds().ravel())
    size = f"the described board of {board.cols + 1} x {board.rows + 1} squares"
    seen = f"markers {ids.min()} to {ids.max()} are in sight, and {size}"
    last = int(layouts[0].getIds().max())
    if not own.any():
        return f"{seen} has 0 to {last}: its first marker is another one"
    if own.sum() < _FEWEST:
        return None
    steps = _steps_squares(corners, board)
    if max(_in_place(layout, steps[own][:, own], ids[own], board) for layout in layouts) < 0.5:
        return f"{seen} has them in other places: it has other numbers of squares"
    if _beyond(steps[~own][:, own]) >= _FEWEST_BEYOND:
        return f"{seen} has 0 to {last} only: it has more squares than described"
    return None


def _steps_squares(corners: FloatArray, board: Board) -> FloatArray:
    """(K, K, 2) from marker i to marker j in squares of marker i, along its own edges."""
    marker = float(board.marker_m or board.square_m) / board.square_m
    along = (corners[:, 1] - corners[:, 0] + corners[:, 2] - corners[:, 3]) / (2 * marker)
    down = (corners[:, 3] - corners[:, 0] + corners[:, 2] - corners[:, 1]) / (2 * marker)
    squares_from_image = np.linalg.inv(np.stack([along, down], axis=-1))
    middle = corners.mean(axis=1)
    steps = np.einsum("iab,ijb->ija", squares_from_image, middle[None] - middle[:, None])
    return np.asarray(steps, dtype=np.float64)


def _nearest(steps: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """(I,) the nearest of the others to each marker, and how far it is in squares."""
    far = np.linalg.norm(steps, axis=2)
    far[far == 0.0] = np.inf
    return far.argmin(axis=1), far.min(axis=1)


def _in_place(layout: Any, steps: FloatArray, ids: NDArray[Any], board: Board) -> float:
    """Share of the markers whose nearest neighbour is where this layout has it."""
    points = dict(zip(layout.getIds().ravel().tolist(), layout.getObjPoints(), strict=True))
    place = np.array([points[k][:, :2].mean(axis=0) for k in ids.tolist()]) / board.square_m
    nearest, far = _nearest(steps)
    near = far < _NEAR_SQUARES
    if not near.any():
        return 1.0
    own = np.arange(len(ids))
    off = np.abs(steps[own, nearest] - (place[nearest] - place)).max(axis=1)
    return float((off[near] < _AGREES_SQUARES).mean())


def _beyond(steps: FloatArray) -> int:
    """How many markers that are none of the board's go on with its pattern."""
    if not len(steps):
        return 0
    nearest, far = _nearest(steps)
    step = steps[np.arange(len(steps)), nearest]
    whole = np.round(step)
    fits = (np.abs(step - whole).max(axis=1) < _AGREES_SQUARES) & (whole.sum(axis=1) % 2 == 0)
    return int((fits & (far < _NEAR_SQUARES)).sum())
