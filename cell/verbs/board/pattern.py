"""The dark rectangles of a board, in millimetres from its top left corner, y downwards."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from calib.views import Board
from cell.errors import InputError
from cell.verbs.board.vector_page import Rectangle


def size_mm(board: Board) -> tuple[float, float]:
    """Width and height of all squares."""
    square = 1e3 * board.square_m
    return (board.cols + 1) * square, (board.rows + 1) * square


def dark(board: Board) -> Iterator[Rectangle]:
    """Every dark rectangle: squares, and the cells of markers.

    The top left square is dark; with rows + cols odd its row (or column) is the side whose two
    corner squares are dark, where row 0 begins. Runs of squares are not joined: each is exact.

    Raises
    ------
    InputError
        The dictionary is unknown or has too few markers.
    """
    side = 1e3 * board.square_m
    for row in range(board.rows + 1):
        for col in range(board.cols + 1):
            if (row + col) % 2 == 0:
                yield col * side, row * side, side, side
    if board.kind == "charuco":
        yield from _markers(board, side)


def _markers(board: Board, side: float) -> Iterator[Rectangle]:
    """The cells of the markers in the light squares, numbered row by row."""
    dictionary = _dictionary(str(board.dictionary))
    size = 1e3 * float(board.marker_m or 0.0)
    light = [
        (row, col)
        for row in range(board.rows + 1)
        for col in range(board.cols + 1)
        if (row + col) % 2
    ]
    if len(light) > len(dictionary.bytesList):
        raise InputError(
            f"--board: needs {len(light)} markers, and {board.dictionary} has"
            f" {len(dictionary.bytesList)}: take a larger dictionary or a smaller board"
        )
    cells = dictionary.markerSize + 2
    gap, cell = (side - size) / 2, size / cells
    for number, (row, col) in enumerate(light):
        image = cv2.aruco.generateImageMarker(dictionary, number, cells)
        for y, x in np.argwhere(np.asarray(image) < 128).tolist():
            yield col * side + gap + x * cell, row * side + gap + y * cell, cell, cell


def _dictionary(name: str) -> cv2.aruco.Dictionary:
    known = getattr(cv2.aruco, name, None)
    if not name.startswith("DICT_") or known is None:
        names = [n for n in dir(cv2.aruco) if n.startswith("DICT_")]
        raise InputError(f"--board: dictionary {name} is not known; known are {', '.join(names)}")
    return cv2.aruco.getPredefinedDictionary(known)
