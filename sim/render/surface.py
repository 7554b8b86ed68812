"""From a pixel back to the board: where each line of sight meets the printed surface.

The chain projects points forwards only; here that same projection is inverted by Newton's
method on a grid of nodes and interpolated between them, so that whatever the chain does to a
corner (distortion, warp, tilt, shutter) happens to every printed edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from calib.chain.projection import project_with_jacobians
from calib.chain.sight import unproject
from calib.views import Board, BoolArray, FloatArray

Image = NDArray[np.float32]

NODE_STEP_PX = 16
_PAD_SQUARES = 3
_ITERATIONS = 12
_TOLERANCE_PX = 1e-7


@dataclass(frozen=True)
class Surface:
    """The board's printed surface in space.

    Attributes
    ----------
    board:
        The nominal board.
    points_m:
        (M, 3) its corners as they are: printed off their grid, warped, scaled.
    """

    board: Board
    points_m: FloatArray

    def point(self, s: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points (Q, 3) in the board frame, metres, and their derivatives by s and by t."""
        square = self.board.square_m
        zero, one = np.zeros_like(s), np.full_like(s, square)
        point = np.stack([s * square, t * square, zero], axis=1)
        by_s, by_t = np.stack([one, zero, zero], axis=1), np.stack([zero, one, zero], axis=1)
        for axis, spline in self._offsets:
            point[:, axis] += spline(t, s, grid=False)
            by_s[:, axis] += spline(t, s, dy=1, grid=False)
            by_t[:, axis] += spline(t, s, dx=1, grid=False)
        return point, by_s, by_t

    @cached_property
    def _offsets(self) -> list[tuple[int, RectBivariateSpline]]:
        """Splines through what the corners depart from their grid, for the axes that depart."""
        board = self.board
        offsets = (self.points_m - board.corners_m).reshape(board.rows, board.cols, 3)
        s, t = (_beyond(places) for places in board.places)
        degree = min(3, board.rows - 1, board.cols - 1)
        return [
            (axis, RectBivariateSpline(t, s, _continued(offsets[:, :, axis]), kx=degree, ky=degree))
            for axis in range(3)
            if np.abs(offsets[:, :, axis]).max() > 0
        ]


def _beyond(places: FloatArray) -> FloatArray:
    """The corners' places along the board, and as many more beyond as `_continued` goes on."""
    step = (places[-1] - places[0]) / (len(places) - 1)
    more = step * np.arange(1, _PAD_SQUARES + 1)
    return np.concatenate([places[0] - more[::-1], places, places[-1] + more])


def _continued(grid: FloatArray) -> FloatArray:
    """Go on beyond the edges as the parabola through the outermost three values would."""
    for axis in (0, 1):
        for side in (1, -1):
            order = np.moveaxis(grid, axis, 0)[::side]
            for _ in range(_PAD_SQUARES):
                ahead = 3 * order[0] - 3 * order[1] + order[2] if len(order) > 2 else order[0]
                order = np.concatenate([ahead[None], order])
            grid = np.moveaxis(order[::side], 0, axis)
    return np.ascontiguousarray(grid)


@dataclass(frozen=True)
class Nodes:
    """The surface seen through every `NODE_STEP_PX`-th pixel.

    Attributes
    ----------
    s, t:
        (R, C) board coordinates in squares; NaN where the line of sight misses the plane.
        Node (i, j) belongs to pixel v = (i - 1) * NODE_STEP_PX, u = (j - 1) * NODE_STEP_PX.
    depth_m:
        (R, C) depth along the optical axis.
    """

    s: FloatArray
    t: FloatArray
    depth_m: FloatArray


def look(
    surface: Surface,
    optics: FloatArray,
    camera_from_board: FloatArray,
    width_px: int,
    height_px: int,
    straightened: Callable[[FloatArray], FloatArray] | None = None,
) -> Nodes:
    """Meet the surface along the lines of sight of a grid of pixels.

    Parameters
    ----------
    surface:
        The board.
    optics, camera_from_board:
        (K,) and (4, 4): the frame's camera and pose.
    width_px, height_px:
        Size of the image.
    straightened:
        Where the lens alone would show what is seen at (Q, 2) pixels; there where it is None.
    """
    rows, cols = (int(np.ceil(n / NODE_STEP_PX)) + 3 for n in (height_px, width_px))
    v, u = np.meshgrid(
        (np.arange(rows) - 1.0) * NODE_STEP_PX,
        (np.arange(cols) - 1.0) * NODE_STEP_PX,
        indexing="ij",
    )
    target = np.stack([u.ravel(), v.ravel()], axis=1)
    if straightened is not None:
        target = straightened(target)
    s, t, met = _newton(surface, optics, camera_from_board, target)
    s, t = np.where(met, s, 0.0), np.where(met, t, 0.0)
    point, _, _ = surface.point(s, t)
    depth = point @ camera_from_board[2, :3] + camera_from_board[2, 3]
    met &= depth > 0
    s, t, depth = (np.where(met, x, np.nan).reshape(rows, cols) for x in (s, t, depth))
    return Nodes(s, t, depth)


def _newton(
    surface: Surface, optics: FloatArray, pose: FloatArray, target_px: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    s, t = _first_guess(surface.board, optics, pose, target_px)
    misfit = np.full(len(s), np.inf)
    open_ = np.arange(len(s))
    for _ in range(_ITERATIONS):
        point, by_s, by_t = surface.point(s[open_], t[open_])
        uv, to_s, to_t = _derivatives(optics, pose, point, by_s, by_t)
        miss = target_px[open_] - uv
        misfit[open_] = np.abs(miss).max(axis=1)
        det = to_s[:, 0] * to_t[:, 1] - to_s[:, 1] * to_t[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            s[open_] += (miss[:, 0] * to_t[:, 1] - miss[:, 1] * to_t[:, 0]) / det
            t[open_] += (to_s[:, 0] * miss[:, 1] - to_s[:, 1] * miss[:, 0]) / det
        going = (misfit[open_] > _TOLERANCE_PX) & np.isfinite(s[open_]) & np.isfinite(t[open_])
        open_ = open_[going]
        if len(open_) == 0:
            break
    return s, t, np.asarray(misfit < 1e-3)


def _derivatives(
    optics: FloatArray, pose: FloatArray, point: FloatArray, by_s: FloatArray, by_t: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    uv, j_pose, _ = project_with_jacobians(optics[None], pose[None], point)
    by_point = j_pose[0, :, :, :3] @ pose[:3, :3]
    to_s, to_t = (np.einsum("qij,qj->qi", by_point, along) for along in (by_s, by_t))
    return uv[0], to_s, to_t


def _first_guess(
    board: Board, optics: FloatArray, pose: FloatArray, target_px: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where the lines of sight meet the flat board; NaN for a pixel that has none."""
    plane = np.linalg.inv(np.stack([pose[:3, 0], pose[:3, 1], pose[:3, 3]], axis=1))
    hit = unproject(optics, target_px) @ plane.T
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = hit[:, :2] / hit[:, 2:]
    return hit[:, 0] / board.square_m, hit[:, 1] / board.square_m
