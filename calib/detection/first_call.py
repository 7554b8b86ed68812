"""Has the compiled parts ready before they are needed."""

from __future__ import annotations

from functools import cache

import numpy as np

from calib.detection.finder import find_chessboard
from calib.detection.marks import drawn_marks
from calib.views import Board

_ROWS, _COLS, _SQUARE_PX = 5, 6, 24


@cache
def make_ready() -> None:
    """Compile or load every kernel, once a process: seconds that no later call has to wait.

    A small board is looked for, and the markers of one are drawn. Whatever a picture's size and
    type, and whatever the board, the kernels get the same types of arguments.
    """
    squares = np.indices((_ROWS + 1, _COLS + 1)).sum(axis=0) % 2
    print_ = np.kron(squares, np.ones((_SQUARE_PX, _SQUARE_PX)))
    picture = np.pad(print_, _SQUARE_PX, constant_values=1.0).astype(np.float32)
    find_chessboard(255 * picture, Board("chessboard", _ROWS, _COLS, 1.0))
    rim = np.stack(np.meshgrid(*[np.arange(4.0) * _SQUARE_PX] * 2), axis=-1)
    drawn_marks((96, 96), rim, Board("charuco", 2, 2, 1.0, 0.7, "DICT_4X4_50"), 0, 1.0)
