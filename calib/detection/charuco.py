"""ChArUco boards: markers say which corner is which, the saddle fit says where it is."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.refine import (
    Fitted,
    doubtful,
    edge_angles,
    fit_closely,
    fit_grid,
    starts,
)
from calib.detection.result import FloatArray, Rejected
from calib.detection.saddle import ANGLE_1, ANGLE_2, CONTRAST, X, Y
from calib.views import Board

_FEWEST_CORNERS = 6
_FEWEST_MARKERS = 2
_NEAREST_MARKER_CORNERS = 6


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


def _eight_bit(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    top = max(255.0, float(np.percentile(image[::5, ::5], 99.5)))
    return np.asarray(np.clip(image * (255.0 / top), 0, 255), dtype=np.uint8)


def _expected_corners(
    layout: Any, marker_corners: Any, marker_ids: Any, board: Board
) -> tuple[float, FloatArray] | None:
    """How badly the markers fit this layout, pixels, and (rows, cols, 2) expected corners."""
    on_board = dict(zip(layout.getIds().ravel().tolist(), layout.getObjPoints(), strict=True))
    known = [k for k, name in enumerate(marker_ids.ravel().tolist()) if name in on_board]
    if len(known) < _FEWEST_MARKERS:
        return None
    pixels = np.concatenate([marker_corners[k].reshape(4, 2) for k in known]).astype(float)
    outlines = [on_board[int(marker_ids.ravel()[k])] for k in known]
    place = np.concatenate(outlines)[:, :2].astype(float) / board.square_m - 1.0
    H, _ = cv2.findHomography(place, pixels, cv2.RANSAC, 0.02 * float(np.ptp(pixels)))
    if H is None:
        return None
    misfit = pixels - cv2.perspectiveTransform(place[None], H)[0]
    corners = board.corners_m[:, :2] / board.square_m
    expected = cv2.perspectiveTransform(corners[None], H)[0]
    for m, corner in enumerate(corners):
        nearest = np.argsort(np.square(place - corner).sum(axis=1))[:_NEAREST_MARKER_CORNERS]
        expected[m] += np.median(misfit[nearest], axis=0)
    return float(np.median(np.abs(misfit))), expected.reshape(board.rows, board.cols, 2)


def _by_markers(image: NDArray[np.float32], board: Board) -> FloatArray | Rejected:
    """(rows, cols, 2) where the markers say the corners are, seen or not."""
    drawn = layouts(board)
    if not drawn:
        return Rejected("a ChArUco board needs the size of its markers and their dictionary")
    detector = cv2.aruco.ArucoDetector(drawn[0].getDictionary())
    marker_corners, marker_ids, _ = detector.detectMarkers(_eight_bit(image))
    if marker_ids is None or len(marker_ids) < _FEWEST_MARKERS:
        return Rejected("fewer than two of the board's markers were read")
    found = [_expected_corners(layout, marker_corners, marker_ids, board) for layout in drawn]
    fitting = [entry for entry in found if entry is not None]
    if not fitting:
        return Rejected("the markers read are not those of this board")
    return min(fitting, key=lambda entry: entry[0])[1]


def _mended(fitted: Fitted, doubt: NDArray[np.bool_], expected_px: FloatArray) -> FloatArray:
    """Fit parameters with the unseen corners where expected, and of typical looks."""
    parameters = fitted.parameters.copy()
    parameters[doubt] = np.median(parameters[~doubt], axis=0)
    parameters[doubt, X], parameters[doubt, Y] = expected_px[doubt].T
    parameters[doubt, ANGLE_1 : ANGLE_2 + 1] = edge_angles(parameters[..., [X, Y]])[doubt]
    odd = np.add.outer(np.arange(doubt.shape[0]), np.arange(doubt.shape[1])) % 2
    typical = np.median(fitted.first_dark_contrast[~doubt])
    parameters[doubt, CONTRAST] = (typical * (1 - 2 * odd))[doubt]
    return parameters


def find_charuco(
    image: NDArray[np.float32], board: Board
) -> tuple[Fitted, NDArray[np.bool_]] | Rejected:
    """Fit all corners of a ChArUco board and say which were not seen, (rows, cols).

    Parameters
    ----------
    image:
        (h, w) grey levels.
    board:
        The board; its markers lie in the bright squares.
    """
    expected = _by_markers(image, board)
    if isinstance(expected, Rejected):
        return expected
    # between the markers of neighbouring bright squares runs a cross free of print
    clear = 0.45 * (1 - (board.marker_m or 0.0) / board.square_m)
    first = fit_grid(image, starts(image, expected, aside=0.7 * clear), clear=clear)
    even_dark = float(np.nanmedian(first.first_dark_contrast)) > 0
    doubt = doubtful(first, expected, even_dark)
    if (~doubt).sum() < _FEWEST_CORNERS:
        return Rejected(f"only {int((~doubt).sum())} of {doubt.size} corners are seen")
    fine = fit_closely(image, _mended(first, doubt, expected), rough=False, clear=clear)
    doubt |= doubtful(fine, expected, even_dark)
    if (~doubt).sum() < _FEWEST_CORNERS:
        return Rejected(f"only {int((~doubt).sum())} of {doubt.size} corners are clear")
    return fine, doubt
