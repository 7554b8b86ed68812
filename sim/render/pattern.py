"""What is printed on the board, as rectangles of even reflectance in the corner grid.

Board coordinates: s along columns, t along rows, in squares, (0, 0) at inner corner (0, 0), so
that inner corner (row, col) lies at s = col, t = row and the printed squares reach one square
beyond the corners on every side.

Colours: the square beyond corner (0, 0), outwards in both directions, is dark, and colours
alternate from there. On a board with an even number of columns and an odd number of rows both
corner squares of row 0 are dark and both of the last row are light; with odd columns and even
rows the same holds for column 0. A ChArUco board follows OpenCV's layout: its corner square
(0, 0) is dark too, markers sit in the light squares, row by row.

An AprilGrid is counted in tags: s and t in sides of a tag, (0, 0) at the top left tag's corner. A
small dark square of the gap's width fills every crossing of gaps, at the rim too; tags are numbered
from the bottom left, row by row upwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from calib.views import Board, FloatArray

WHITE, BLACK, BACKGROUND = 0.85, 0.04, 0.25
"""Reflectance of paper, of toner, and of what stands behind the board."""

_QUIET_ZONE_SQUARES = 1.0
_FAR = 1e9
_OUTSIDE, _MARGIN = -2, -1
TAG_BORDER = 2
"""Modules of a tag's black border on Kalibr's boards."""


@dataclass(frozen=True)
class Pattern:
    """A printed board, ready for the compiled loops.

    Attributes
    ----------
    rows, cols:
        Inner corners; of an AprilGrid, tags.
    quiet_zone:
        White margin around the printed squares, in squares.
    marker_side:
        Side of a marker in squares; 0 for a plain chessboard.
    bits:
        (markers, cells, cells) reflectance of each marker's cells, its border included.
    marker_of_square:
        (rows + 1, cols + 1) index of the marker in each square, -1 for none; of an AprilGrid
        (rows, cols) the number of each tag.
    gap:
        Between the tags of an AprilGrid, in squares; 0 for other boards.
    """

    rows: int
    cols: int
    quiet_zone: float
    marker_side: float
    bits: FloatArray
    marker_of_square: FloatArray
    gap: float = 0.0

    @property
    def shape(self) -> FloatArray:
        """(5,) rows, cols, quiet zone, marker side, gap, as the compiled loops take them."""
        sides = [self.rows, self.cols, self.quiet_zone, self.marker_side, self.gap]
        return np.array(sides, float)


def pattern_of(board: Board) -> Pattern:
    """The print of a board; raises `ValueError` for a ChArUco board without its markers."""
    none = np.full((board.rows + 1, board.cols + 1), -1.0)
    if board.kind == "chessboard":
        return Pattern(board.rows, board.cols, _QUIET_ZONE_SQUARES, 0.0, np.zeros((0, 1, 1)), none)
    if board.kind == "aprilgrid":
        return _tag_grid(board)
    if board.marker_m is None or board.dictionary is None:
        raise ValueError("a charuco board needs marker_m and dictionary")
    light = np.add.outer(np.arange(board.rows + 1), np.arange(board.cols + 1)) % 2 == 1
    none[light] = np.arange(light.sum())
    return Pattern(
        rows=board.rows,
        cols=board.cols,
        quiet_zone=_QUIET_ZONE_SQUARES,
        marker_side=board.marker_m / board.square_m,
        bits=_marker_cells(board.dictionary, int(light.sum())),
        marker_of_square=none,
    )


def _tag_grid(board: Board) -> Pattern:
    rows, cols = board.rows // 2, board.cols // 2
    return Pattern(
        rows=rows,
        cols=cols,
        quiet_zone=_QUIET_ZONE_SQUARES,
        marker_side=1.0,
        bits=_marker_cells(str(board.dictionary), rows * cols, TAG_BORDER),
        marker_of_square=np.arange(rows * cols, dtype=float).reshape(rows, cols)[::-1].copy(),
        gap=float(board.gap_m or 0.0) / board.square_m,
    )


def _marker_cells(dictionary: str, count: int, border: int = 1) -> FloatArray:
    number = getattr(cv2.aruco, dictionary, None)
    if number is None:
        raise ValueError(f"unknown marker dictionary {dictionary!r}: use an OpenCV name")
    markers = cv2.aruco.getPredefinedDictionary(number)
    cells = markers.markerSize + 2 * border
    if count > len(markers.bytesList):
        raise ValueError(f"{count} markers are more than {dictionary} has")
    drawn = [
        cv2.aruco.generateImageMarker(markers, i, cells, borderBits=border) for i in range(count)
    ]
    return np.where(np.array(drawn) > 127, WHITE, BLACK).astype(float)


@njit(cache=True)
def leaf(s, t, shape, bits, marker_of_square, out):  # type: ignore[no-untyped-def]
    """Reflectance at (s, t); the rectangle around it of the same reflectance goes to `out`.

    `out` becomes (s_low, s_high, t_low, t_high).
    """
    rows, cols, quiet, side, gap = shape
    if gap > 0.0:
        return _tags(s, t, rows, cols, quiet, gap, bits, marker_of_square, out)
    if s < -1.0 or s >= cols or t < -1.0 or t >= rows:
        return _around(s, t, rows, cols, quiet, out)
    column, row = np.floor(s), np.floor(t)
    out[0], out[1], out[2], out[3] = column, column + 1.0, row, row + 1.0
    i, j = int(row) + 1, int(column) + 1
    if (i + j) % 2 == 0:
        return BLACK
    marker = int(marker_of_square[i, j])
    if marker < 0:
        return WHITE
    return _marker(s - column, t - row, column, row, side, bits[marker], out)


@njit(cache=True)
def _tags(s, t, rows, cols, quiet, gap, bits, tag_at, out):  # type: ignore[no-untyped-def]
    """An AprilGrid: tags, small squares where gaps cross, white between."""
    column, x = _gap_or_tag(s, cols, gap, quiet, out, 0)
    row, y = _gap_or_tag(t, rows, gap, quiet, out, 2)
    if column == _OUTSIDE or row == _OUTSIDE:
        return BACKGROUND
    if column == _MARGIN or row == _MARGIN or (x < 0.0) != (y < 0.0):
        return WHITE
    if x < 0.0:
        return BLACK
    cells = bits[int(tag_at[row, column])]
    n = cells.shape[0]
    k, m = min(int(x * n), n - 1), min(int(y * n), n - 1)
    left, top = column * (1.0 + gap), row * (1.0 + gap)
    out[0], out[1] = left + k / n, left + (k + 1) / n
    out[2], out[3] = top + m / n, top + (m + 1) / n
    return cells[m, k]


@njit(cache=True)
def _gap_or_tag(x, count, gap, quiet, out, k):  # type: ignore[no-untyped-def]
    """Which tag's stripe x lies in and where, negative for the gap before it; its bounds."""
    end = count * (1.0 + gap)
    if x < -gap - quiet or x >= end + quiet:
        out[k], out[k + 1] = (-_FAR, -gap - quiet) if x < 0.0 else (end + quiet, _FAR)
        return _OUTSIDE, 0.0
    if x < -gap or x >= end:
        out[k], out[k + 1] = (-gap - quiet, -gap) if x < 0.0 else (end, end + quiet)
        return _MARGIN, 0.0
    tag = int(np.floor((x + gap) / (1.0 + gap)))
    inside = x - tag * (1.0 + gap)
    low = tag * (1.0 + gap)
    if inside < 0.0:
        out[k], out[k + 1] = low - gap, low
        return tag, inside
    out[k], out[k + 1] = low, low + 1.0
    return tag, inside


@njit(cache=True)
def _around(s, t, rows, cols, quiet, out):  # type: ignore[no-untyped-def]
    """Outside the printed squares: the white margin, then the background."""
    _stripe(s, -1.0, cols, quiet, out, 0)
    _stripe(t, -1.0, rows, quiet, out, 2)
    if -1.0 - quiet <= s < cols + quiet and -1.0 - quiet <= t < rows + quiet:
        return WHITE
    return BACKGROUND


@njit(cache=True)
def _stripe(x, low, high, quiet, out, k):  # type: ignore[no-untyped-def]
    """Bounds of the stripe that x lies in: background, margin, one square, margin, background."""
    if x < low - quiet:
        out[k], out[k + 1] = -_FAR, low - quiet
    elif x < low:
        out[k], out[k + 1] = low - quiet, low
    elif x < high:
        out[k] = np.floor(x)
        out[k + 1] = out[k] + 1.0
    elif x < high + quiet:
        out[k], out[k + 1] = high, high + quiet
    else:
        out[k], out[k + 1] = high + quiet, _FAR


@njit(cache=True)
def _marker(x, y, column, row, side, cells, out):  # type: ignore[no-untyped-def]
    """A light square with a marker in its middle; (x, y) within the square."""
    low, high = 0.5 - side / 2.0, 0.5 + side / 2.0
    if x < low:
        out[1] = column + low
        return WHITE
    if x >= high:
        out[0] = column + high
        return WHITE
    if y < low or y >= high:
        out[0], out[1] = column + low, column + high
        if y < low:
            out[3] = row + low
        else:
            out[2] = row + high
        return WHITE
    n = cells.shape[0]
    cell = side / n
    k, m = min(int((x - low) / cell), n - 1), min(int((y - low) / cell), n - 1)
    out[0], out[1] = column + low + k * cell, column + low + (k + 1) * cell
    out[2], out[3] = row + low + m * cell, row + low + (m + 1) * cell
    return cells[m, k]
