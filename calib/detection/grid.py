"""Lays the board's rows and columns over a lattice of corners."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from calib.detection.lattice import Lattice
from calib.detection.result import FloatArray, Rejected
from calib.views import Board

_FEWEST_SEEN = 0.6
_MOST_PLACEMENTS = 4
# a board's lines bend by a few percent of a square from corner to corner, chance's by about one
_MOST_UNEVEN = 0.4


@dataclass(frozen=True)
class Grid:
    """Corners in the board's order.

    Attributes
    ----------
    corners_px:
        (rows, cols, 2) pixels of the image they were found in; NaN where still missing.
    first_dark:
        Whether the square outside corner (0, 0) is dark.
    """

    corners_px: FloatArray
    first_dark: bool

    @property
    def missing(self) -> int:
        """Number of corners not yet found."""
        return int(np.isnan(self.corners_px[..., 0]).sum())

    def turned(self, quarters: int) -> Grid:
        """The same grid counted from another of its corners; never mirrored."""
        # every quarter turn brings a square of the other colour outside corner (0, 0) when the
        # number of corners along the side it runs along is odd
        corners, dark = self.corners_px, self.first_dark
        for _ in range(quarters % 4):
            dark ^= corners.shape[1] % 2 == 1
            corners = np.rot90(corners)
        return Grid(corners, dark)


def spread_out(lattice: Lattice) -> Grid:
    """The whole lattice as one grid, NaN where it has no corner."""
    low = lattice.cells.min(axis=0)
    places = lattice.cells - low
    corners = np.full((*(places.max(axis=0) + 1), 2), np.nan)
    corners[places[:, 0], places[:, 1]] = lattice.xy
    return Grid(corners, bool(lattice.dark_first ^ (int(low.sum()) % 2 == 1)))


def _padded(grid: Grid, rows: int, cols: int) -> Grid:
    """A ring of missing corners all round, so that an incomplete board still has a place."""
    pad_rows = max(2, 2 * ((rows - grid.corners_px.shape[0] + 3) // 2))
    pad_cols = max(2, 2 * ((cols - grid.corners_px.shape[1] + 3) // 2))
    pad = ((pad_rows, pad_rows), (pad_cols, pad_cols), (0, 0))
    return Grid(np.pad(grid.corners_px, pad, constant_values=np.nan), grid.first_dark)


def _window_counts(seen: FloatArray, rows: int, cols: int) -> FloatArray:
    """Number of corners inside a rows x cols window at each of its places."""
    total = np.pad(seen.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    return np.asarray(
        total[rows:, cols:] - total[:-rows, cols:] - total[rows:, :-cols] + total[:-rows, :-cols]
    )


def _placements(whole: Grid, rows: int, cols: int) -> Iterator[tuple[int, Grid]]:
    seen = np.isfinite(whole.corners_px[..., 0]).astype(float)
    counts = _window_counts(seen, rows, cols)
    for i, j in np.argwhere(counts >= max(counts.max() - 1, _FEWEST_SEEN * rows * cols)):
        inside = whole.corners_px[i : i + rows, j : j + cols]
        yield int(counts[i, j]), Grid(inside, whole.first_dark ^ bool((i + j) % 2))


def _has_full_line_outside(lattice: Lattice, rows: int, cols: int) -> bool:
    """Whether the lattice is clearly larger than the board."""
    seen = np.isfinite(spread_out(lattice).corners_px[..., 0])
    long, short = max(rows, cols), min(rows, cols)
    full_rows = int((seen.sum(axis=1) >= short).sum())
    full_cols = int((seen.sum(axis=0) >= short).sum())
    return min(full_rows, full_cols) > short or max(full_rows, full_cols) > long


def _is_even(grid: Grid) -> bool:
    """Whether corners that follow each other lie about in line and equally far apart."""
    bends = []
    for line in (grid.corners_px, np.moveaxis(grid.corners_px, 1, 0)):
        step, second = line[2:] - line[:-2], line[2:] - 2 * line[1:-1] + line[:-2]
        bend = 2 * np.linalg.norm(second, axis=-1) / np.linalg.norm(step, axis=-1)
        bends.append(bend[np.isfinite(bend)])
    return float(np.median(np.concatenate(bends))) < _MOST_UNEVEN


def place_board(lattice: Lattice, board: Board) -> list[Grid] | Rejected:
    """The ways in which the board may lie on the lattice, the fullest first.

    A list of at most four grids, each rows x cols and not mirrored, or why there is none.
    """
    if _has_full_line_outside(lattice, board.rows, board.cols):
        return Rejected(f"the pattern seen is larger than {board.rows} x {board.cols} corners")
    found: list[tuple[int, Grid]] = []
    whole = spread_out(lattice)
    for quarters in (0, 1) if board.rows != board.cols else (0,):
        turned = _padded(whole.turned(quarters), board.rows, board.cols)
        found += _placements(turned, board.rows, board.cols)
    if not found:
        return Rejected(f"only {len(lattice)} of {board.corner_count} corners hang together")
    found.sort(key=lambda entry: -entry[0])
    even = [grid for _, grid in found[:_MOST_PLACEMENTS] if _is_even(grid)]
    return even or Rejected(f"what looks like {len(lattice)} corners lies in no rows and columns")


def in_board_order(grid: Grid, board: Board) -> Grid:
    """Count from the corner the colours name, or else from the one nearest the top left.

    Where rows + cols is odd, the square outside corner (0, 0) is dark, which makes the side
    whose two corner squares are dark row 0 (or column 0 where cols is odd).
    """
    turns = (0, 2) if board.rows != board.cols else (0, 1, 2, 3)
    options = [grid.turned(turn) for turn in turns]
    if any(option.first_dark for option in options):
        options = [option for option in options if option.first_dark]
    return min(options, key=lambda option: float(option.corners_px[0, 0].sum()))


def with_predictions(grid: Grid) -> Grid:
    """Missing corners put where a homography through the others expects them.

    The homography's own misfit at the nearest corners is added, since a lens bends the board.
    """
    rows, cols = grid.corners_px.shape[:2]
    place = np.argwhere(np.ones((rows, cols)))[:, ::-1].astype(float)
    pixels = grid.corners_px.reshape(-1, 2)
    known = np.isfinite(pixels[:, 0])
    if known.all():
        return grid
    H, _ = cv2.findHomography(place[known], pixels[known])
    if H is None:
        return grid
    expected = cv2.perspectiveTransform(place[None], H)[0]
    misfit = pixels[known] - expected[known]
    filled = pixels.copy()
    for m in np.flatnonzero(~known):
        nearest = np.argsort(np.square(place[known] - place[m]).sum(axis=1))[:4]
        filled[m] = expected[m] + misfit[nearest].mean(axis=0)
    return Grid(filled.reshape(rows, cols, 2), grid.first_dark)
