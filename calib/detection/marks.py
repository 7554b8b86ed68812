"""What the markers of a ChArUco board put into a picture: how dark they make each pixel."""

from __future__ import annotations

from functools import cache
from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from calib.detection.markers import layouts, marker_squares
from calib.detection.result import FloatArray
from calib.views import Board

_SAMPLES = 4


@numba.njit(cache=True, nogil=True)
def _cover(dark: Any, cells_from_image: Any, low: Any, high: Any, marks: Any) -> None:
    """Add to each pixel from `low` to `high` the share of its square that is dark."""
    M = cells_from_image
    n = dark.shape[0]
    for y in range(low[1], high[1]):
        for x in range(low[0], high[0]):
            hits = 0
            for k in range(_SAMPLES * _SAMPLES):
                px = x + (k % _SAMPLES + 0.5) / _SAMPLES - 0.5
                py = y + (k // _SAMPLES + 0.5) / _SAMPLES - 0.5
                w = M[2, 0] * px + M[2, 1] * py + M[2, 2]
                a = (M[0, 0] * px + M[0, 1] * py + M[0, 2]) / w
                b = (M[1, 0] * px + M[1, 1] * py + M[1, 2]) / w
                if 0.0 <= a < n and 0.0 <= b < n and dark[int(b), int(a)]:
                    hits += 1
            marks[y, x] += hits / (_SAMPLES * _SAMPLES)


@cache
def _dark_cells(board: Board) -> NDArray[np.bool_]:
    """(markers, cells, cells) which cells of each marker are dark, its border included."""
    layout = layouts(board)[0]
    dictionary = layout.getDictionary()
    cells = dictionary.markerSize + 2
    drawn = [
        cv2.aruco.generateImageMarker(dictionary, name, cells)
        for name in layout.getIds().ravel().tolist()
    ]
    return np.array(drawn) < 128


def drawn_marks(
    shape: tuple[int, int], around_px: FloatArray, board: Board, layout: int, sigma_px: float
) -> NDArray[np.float32]:
    """(h, w) share of each pixel that the markers make dark.

    Parameters
    ----------
    shape:
        (h, w) of the picture.
    around_px:
        (rows + 2, cols + 2, 2) the board's corners and those of its rim.
    board, layout:
        The board, and which of its `layouts` it has.
    sigma_px:
        Gaussian blur of the picture without the pixel's own.
    """
    marks = np.zeros(shape, np.float32)
    dark = _dark_cells(board)
    cells = dark.shape[1]
    share = float(board.marker_m or 0.0) / board.square_m
    margin = cells * (1 / share - 1) / 2
    outline = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * cells / share - margin
    square = outline.astype(np.float32)
    for cells_dark, (i, j) in zip(dark, marker_squares(board)[layout], strict=True):
        corners = around_px[[i, i, i + 1, i + 1], [j, j + 1, j + 1, j]].astype(np.float32)
        M = np.asarray(cv2.getPerspectiveTransform(corners, square), dtype=np.float64)
        limits = np.array(shape[::-1])
        low = np.clip(np.floor(corners.min(axis=0)), 0, limits).astype(np.int64)
        high = np.clip(np.ceil(corners.max(axis=0)) + 1, 0, limits).astype(np.int64)
        _cover(cells_dark, M, low, high, marks)
    if sigma_px > 0.1:
        marks = np.asarray(cv2.GaussianBlur(marks, (0, 0), sigma_px), dtype=np.float32)
    return marks
