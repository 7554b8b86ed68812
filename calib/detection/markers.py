"""Which corner of a ChArUco board is which, by the look of the markers between the corners.

The squares' places are known from the lattice, so that a marker need not be cut out and read bit
by bit: the grey levels where its cells must lie are compared with what each marker of the board
would show there, blurred by various amounts. That goes on where the cells are far too blurred or
too small to be read one by one, and all markers in sight decide together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.grid import Grid
from calib.detection.result import FloatArray
from calib.views import Board

_FINE = 5
_BLURS_CELLS = (0.3, 0.7, 1.2, 2.0, 3.0)
_FEWEST_MARKERS = 2
_LEAST_LIKENESS = 0.5
_MOST_RANKED = 8
# of the picture's contrast: what varies by less is an even square, whatever its noise looks like
_EVEN = 0.03


@dataclass(frozen=True)
class Placement:
    """How a board lies on a grid: turned, then its corner (0, 0) at corner (row, col) of it.

    `layout` says which of `layouts` it has.
    """

    quarters: int
    row: int
    col: int
    layout: int

    @property
    def where(self) -> tuple[int, int, int]:
        """Turn, row and column; all 0 where the grid is counted as the board is."""
        return self.quarters, self.row, self.col


def layouts(board: Board) -> list[Any]:
    """OpenCV's description of the board, as drawn since version 4.6 and as before."""
    if board.marker_m is None or board.dictionary is None:
        return []
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    size = (board.cols + 1, board.rows + 1)
    both = []
    for legacy in (False, True):
        layout = cv2.aruco.CharucoBoard(size, board.square_m, board.marker_m, dictionary)
        layout.setLegacyPattern(legacy)
        both.append(layout)
    return both


@cache
def marker_squares(board: Board) -> list[NDArray[np.int64]]:
    """For each layout (markers, 2) row and column of the square that each marker lies in."""
    middles = [
        np.array([outline[:, :2].mean(axis=0) for outline in layout.getObjPoints()])
        for layout in layouts(board)
    ]
    return [np.floor(middle[:, ::-1] / board.square_m).astype(np.int64) for middle in middles]


@cache
def _looks(board: Board) -> FloatArray:
    """(blurs, markers, cells) grey levels at the cells' middles, each of mean 0 and length 1."""
    layout = layouts(board)[0]
    dictionary = layout.getDictionary()
    cells = dictionary.markerSize + 2
    quiet = round(_FINE * cells * (board.square_m / float(board.marker_m or 1.0) - 1) / 2)
    middles = quiet + _FINE * cells + _FINE * np.arange(1, cells - 1) + _FINE // 2
    looks = []
    for sigma in _BLURS_CELLS:
        for name in layout.getIds().ravel().tolist():
            drawn = cv2.aruco.generateImageMarker(dictionary, name, _FINE * cells)
            square = np.pad(drawn.astype(np.float32), quiet, constant_values=255)
            around = np.pad(square, _FINE * cells)
            soft = cv2.GaussianBlur(around, (0, 0), _FINE * sigma)
            looks.append(soft[np.ix_(middles, middles)].ravel())
    levels = np.array(looks) - np.mean(looks, axis=1, keepdims=True)
    levels /= np.linalg.norm(levels, axis=1, keepdims=True)
    return np.asarray(levels.reshape(len(_BLURS_CELLS), -1, levels.shape[1]))


def _seen(image: NDArray[np.float32], corners_px: FloatArray, board: Board) -> FloatArray:
    """(squares, cells) grey levels where the cells of markers would lie."""
    cells = layouts(board)[0].getDictionary().markerSize + 2
    share = float(board.marker_m or 0.0) / board.square_m
    across = 0.5 + share * ((np.arange(1, cells - 1) + 0.5) / cells - 0.5)
    b, a = (part.ravel() for part in np.meshgrid(across, across, indexing="ij"))
    weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=1)
    places = np.einsum("cq,sqx->scx", weights, corners_px).astype(np.float32)
    return np.asarray(
        cv2.remap(image, places[..., 0], places[..., 1], cv2.INTER_LINEAR), dtype=np.float64
    )


def _light_squares(grid: Grid) -> tuple[NDArray[np.int64], FloatArray]:
    """(S, 2) places of the bright squares whose corners are all known, (S, 4, 2) those corners."""
    p = grid.corners_px
    corners = np.stack([p[:-1, :-1], p[:-1, 1:], p[1:, :-1], p[1:, 1:]], axis=2)
    odd = np.add.outer(np.arange(corners.shape[0]), np.arange(corners.shape[1])) % 2 == 1
    known = np.isfinite(corners).all(axis=(2, 3)) & (odd if grid.first_dark else ~odd)
    return np.argwhere(known), corners[known]


def _likenesses(image: NDArray[np.float32], corners_px: FloatArray, board: Board) -> FloatArray:
    """(blurs, S, markers) correlation of S squares with the board's markers."""
    levels = _seen(image, corners_px, board)
    levels -= levels.mean(axis=1, keepdims=True)
    contrast = max(float(image.max() - image.min()), 1e-6)
    length = np.linalg.norm(levels, axis=1, keepdims=True)
    levels /= np.maximum(length, _EVEN * contrast * np.sqrt(levels.shape[1]))
    return np.asarray(np.einsum("sc,bmc->bsm", levels, _looks(board)))


def _ranked(
    likeness: FloatArray, squares: NDArray[np.int64], markers: NDArray[np.int64]
) -> list[tuple[float, int, int, int]]:
    """Summed likeness, number of markers, row and column of each place the board may have.

    A marker in a square leaves one place for the board: every pair of the two counts for one.
    """
    shift = squares[:, None] - markers
    low = shift.min(axis=(0, 1))
    span = shift.max(axis=(0, 1)) - low + 1
    place = ((shift[..., 0] - low[0]) * span[1] + shift[..., 1] - low[1]).ravel()
    size = int(span.prod())
    sums = [np.bincount(place, of_blur.ravel(), size) for of_blur in likeness]
    total = max(sums, key=lambda values: float(values.max()))
    counts = np.bincount(place, minlength=size)
    likely = np.argsort(-total)[:_MOST_RANKED]
    rows, cols = np.divmod(likely, span[1])
    return [
        (float(total[k]), int(counts[k]), int(row + low[0] + 1), int(col + low[1] + 1))
        for k, row, col in zip(likely, rows, cols, strict=True)
    ]


def place_by_markers(
    image: NDArray[np.float32], grid: Grid, board: Board, *, runner_up: float = 0.6
) -> Placement | None:
    """How the board lies on a grid of corners, or None where the markers do not show clearly.

    Parameters
    ----------
    image:
        (h, w) grey levels.
    grid:
        Corners in this image, some of them NaN, turned and shifted anyhow but not mirrored.
    board:
        A ChArUco board.
    runner_up:
        As alike as this, compared with the best, may the next best place be.
    """
    ranking: list[tuple[float, int, Placement]] = []
    for quarters in range(4):
        squares, corners = _light_squares(grid.turned(quarters))
        if len(squares) < _FEWEST_MARKERS:
            return None
        likeness = _likenesses(image, corners, board)
        for layout, markers in enumerate(marker_squares(board)):
            for total, count, row, col in _ranked(likeness, squares, markers):
                ranking.append((total, count, Placement(quarters, row, col, layout)))
    ranking.sort(key=lambda entry: -entry[0])
    total, count, best = ranking[0]
    # the two layouts are one and the same on boards of some sizes
    others = [entry[0] for entry in ranking if entry[2].where != best.where]
    clear = total >= _LEAST_LIKENESS * count and max(others, default=0.0) <= runner_up * total
    return best if count >= _FEWEST_MARKERS and clear else None


def on_board(grid: Grid, place: Placement, board: Board) -> Grid:
    """The board's own corners of a grid, NaN where the grid does not reach or has none."""
    turned = grid.turned(place.quarters)
    corners = np.full((board.rows, board.cols, 2), np.nan)
    rows, cols = turned.corners_px.shape[:2]
    r = np.arange(max(0, -place.row), min(board.rows, rows - place.row))
    c = np.arange(max(0, -place.col), min(board.cols, cols - place.col))
    corners[np.ix_(r, c)] = turned.corners_px[np.ix_(r + place.row, c + place.col)]
    return Grid(corners, turned.first_dark ^ bool((place.row + place.col) % 2))
