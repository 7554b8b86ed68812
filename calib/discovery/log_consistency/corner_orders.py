"""Single frames whose corners are numbered from another end of the board, or across it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.calibration.frames import CORNERS_NEEDED
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_consistency.odd_frames import OddFrames
from calib.paper.homography import apply_homography, linear_homography
from calib.views import Board, FloatArray, Views


@dataclass(frozen=True)
class CornerOrder:
    """A numbering of the same corners.

    Attributes
    ----------
    description:
        What was done to rows and columns.
    place:
        (M,) number that corner k truly has.
    true_from_named:
        (4, 4) where a corner of a flat board truly is, from where its number says.
    """

    description: str
    place: NDArray[np.int64]
    true_from_named: FloatArray


def corner_orders(board: Board) -> list[CornerOrder]:
    """Every other numbering of the board's grid by rows and columns."""
    grid = np.arange(board.corner_count).reshape(board.rows, board.cols)
    orders = {
        "rows and columns run backwards": grid[::-1, ::-1],
        "rows run backwards": grid[::-1],
        "columns run backwards": grid[:, ::-1],
    }
    if board.rows == board.cols:
        orders["rows and columns are exchanged"] = grid.T
        orders["the board is turned by a quarter"] = np.rot90(grid)
        orders["the board is turned by three quarters"] = np.rot90(grid, 3)
        orders["rows and columns are exchanged and run backwards"] = grid[::-1, ::-1].T
    return [
        CornerOrder(
            description, np.asarray(order).ravel(), _rigid(board, np.asarray(order).ravel())
        )
        for description, order in orders.items()
    ]


def _rigid(board: Board, place: NDArray[np.int64]) -> FloatArray:
    """A mirrored grid is the flat board turned over, which is rigid."""
    points = board.corners_m
    turn = np.linalg.lstsq(points[:, :2] - points[0, :2], points[place] - points[place[0]],
                           rcond=None)[0].T  # fmt: skip
    out = np.eye(4)
    out[:3, :2] = turn
    out[:3, 2] = np.cross(turn[:, 0], turn[:, 1])
    out[:3, 3] = points[place[0]] - out[:3, :3] @ points[0]
    return out


def find_corner_orders(views: Views, odd: OddFrames, camera_from_board: FloatArray) -> Mixup | None:
    """Name the odd frames that fit their own pose once their corners are numbered otherwise.

    Parameters
    ----------
    views, odd:
        The frames, and which do not fit their pose.
    camera_from_board:
        (N, 4, 4) free poses.
    """
    found: dict[int, CornerOrder] = {}
    for order in corner_orders(views.board):
        renamed = camera_from_board @ np.linalg.inv(order.true_from_named)
        for i in odd.fitting(views, renamed):
            found.setdefault(int(views.frame[i]), order)
    if not found:
        return None
    reported = ", ".join(
        f"frame {frame}: {order.description}" for frame, order in sorted(found.items())
    )
    return Mixup(
        name="corner_order",
        physics=f"Corners are numbered otherwise than in the other frames: {reported}.",
        remedy="Number the corners from the same end of the board in every frame.",
        mend=_renumbering(found),
        parameters={"frames": (float(len(found)), "frame")},
    )


_LISTED_WRONG_PX, _LISTED_BETTER = 3.0, 0.1
"""By how much numbers of a wrong listing miss a plane, in the median; and what is left of it."""


def find_listing(views: Views) -> Mixup | None:
    """Name corners that are listed by columns in every frame, where the board is not square.

    Parameters
    ----------
    views:
        The frames; no plane shows its corners where such a list says.
    """
    board = views.board
    if board.rows == board.cols:
        return None
    logged = _plane_miss_px(views)
    if logged < _LISTED_WRONG_PX:
        return None
    place = np.arange(board.corner_count).reshape(board.cols, board.rows).T.ravel()

    def mend(some: Views, neighbours: Views) -> Views:
        return replace(
            some,
            corners_px=some.corners_px[:, place],
            corner_sigma_px=some.corner_sigma_px[:, place],
        )

    if _plane_miss_px(mend(views, views)) > _LISTED_BETTER * logged:
        return None
    return Mixup(
        name="corner_order",
        physics="The corners of every frame are listed by columns, where the recording says rows.",
        remedy="List corners row by row, or exchange the board's rows and columns.",
        mend=mend,
        parameters={"frames": (float(len(views)), "frame")},
    )


def _plane_miss_px(views: Views) -> float:
    """Median over frames of how far corners lie from the plane that fits them best."""
    misses = []
    for seen, corners in zip(views.seen, views.corners_px, strict=True):
        if seen.sum() < CORNERS_NEEDED:
            continue
        flat, shown = views.board.corners_m[seen, :2], corners[seen]
        plane = linear_homography(flat, shown)
        misses.append(float(np.sqrt(np.mean((apply_homography(plane, flat) - shown) ** 2))))
    return float(np.median(misses)) if misses else 0.0


def _renumbering(found: Mapping[int, CornerOrder]) -> Callable[[Views, Views], Views]:
    def mend(some: Views, neighbours: Views) -> Views:
        corners, sigma = some.corners_px.copy(), some.corner_sigma_px.copy()
        for i, frame in enumerate(some.frame):
            order = found.get(int(frame))
            if order is not None:
                corners[i, order.place] = some.corners_px[i]
                sigma[i, order.place] = some.corner_sigma_px[i]
        return replace(some, corners_px=corners, corner_sigma_px=sigma)

    return mend
