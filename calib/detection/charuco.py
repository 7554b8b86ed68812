"""ChArUco boards: markers say which corner is which, the saddle fit says where it is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.candidates import find_candidates
from calib.detection.charuco_fit import FEWEST_CORNERS, Guess, Seen, fit_charuco
from calib.detection.grid import spread_out, with_predictions
from calib.detection.lattice import grow_lattices
from calib.detection.markers import layouts, on_board, place_by_markers
from calib.detection.other_board import other_board
from calib.detection.refine import Fitted
from calib.detection.result import FloatArray, Rejected
from calib.detection.scales import scaled, scales
from calib.views import Board

_FEWEST_MARKERS = 2
_NEAREST_MARKER_CORNERS = 6
_MOST_PIECES = 3
# a piece of the board may leave more doubt than the whole, which is judged once it is fitted
_RUNNER_UP = 0.85
# a guess that gives this share of the corners is not followed by others
_ENOUGH = 0.8
# the reader takes seconds for some pictures of twelve megapixels
_READ_PIXELS = 2e6


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


def _read_markers(image: NDArray[np.float32], board: Board) -> tuple[Any, Any]:
    """Outlines and numbers of the dictionary's markers that can be read; None where none can."""
    dictionary = layouts(board)[0].getDictionary()
    settings = cv2.aruco.DetectorParameters()
    # cells of less than two pixels cannot be read, but looking at all such specks takes seconds
    least_side_px = 2 * (dictionary.markerSize + 2)
    settings.minMarkerPerimeterRate = 4 * least_side_px / max(image.shape)
    detector = cv2.aruco.ArucoDetector(dictionary, settings)
    marker_corners, marker_ids, _ = detector.detectMarkers(_eight_bit(image))
    return marker_corners, marker_ids


def _by_reading(marker_corners: Any, marker_ids: Any, board: Board) -> Guess | Rejected:
    """Where the markers that can be read say the corners are, seen or not."""
    if marker_ids is None or len(marker_ids) < _FEWEST_MARKERS:
        return Rejected("fewer than two of the board's markers were read")
    drawn = layouts(board)
    found = [_expected_corners(layout, marker_corners, marker_ids, board) for layout in drawn]
    fitting = [entry for entry in found if entry is not None]
    if not fitting:
        return Rejected("the markers read are not those of this board")
    return Guess(min(fitting, key=lambda entry: entry[0])[1])


def _by_lattice(image: NDArray[np.float32], board: Board) -> Guess | None:
    """Where a lattice of corners that seems to bear the board's markers has the corners."""
    for lattice in grow_lattices(find_candidates(image))[:_MOST_PIECES]:
        grid = spread_out(lattice)
        place = place_by_markers(image, grid, board, runner_up=_RUNNER_UP)
        if place is None:
            continue
        corners = on_board(grid, place, board)
        if board.corner_count - corners.missing >= FEWEST_CORNERS:
            return Guess(with_predictions(corners).corners_px, place.layout)
    return None


def _guesses(
    image: NDArray[np.float32], read: Guess | Rejected, board: Board
) -> Iterator[Guess | Rejected]:
    """Where the corners may be in the full image, one guess after the other."""
    yield read
    for scale in scales(image.shape):
        held = _by_lattice(scaled(image, scale), board)
        if held is not None:
            yield held.enlarged(scale)


def find_charuco(
    image: NDArray[np.float32], board: Board
) -> tuple[Fitted, NDArray[np.bool_]] | Rejected:
    """Fit all corners of a ChArUco board and say which were not seen, (rows, cols).

    The markers are read first; where that does not give most corners, lattices of crossings are
    held against the markers that should lie between them. The best guess wins. Markers that cannot
    be this board's end the search.

    Parameters
    ----------
    image:
        (h, w) grey levels.
    board:
        The board; its markers lie in the bright squares.
    """
    if not layouts(board):
        return Rejected("a ChArUco board needs the size of its markers and their dictionary")
    readable = next(s for s in (1.0, 0.5, 0.25, 0.125) if image.size * s * s <= _READ_PIXELS)
    marker_corners, marker_ids = _read_markers(scaled(image, readable), board)
    other = other_board(layouts(board), marker_corners, marker_ids, board)
    if other is not None:
        return Rejected(other)
    read = _by_reading(marker_corners, marker_ids, board)
    read = read if isinstance(read, Rejected) else read.enlarged(readable)
    best: Seen | None = None
    reason: Rejected | None = None
    for guess in _guesses(image, read, board):
        seen = guess if isinstance(guess, Rejected) else fit_charuco(image, guess, board)
        if isinstance(seen, Rejected):
            reason = seen if reason is None else reason
        elif best is None or seen.rank() > best.rank():
            best = seen
        if best and best.named_by_markers and best.share_seen(image.shape) >= _ENOUGH:
            break
    if best is not None:
        return best.fitted, best.unseen
    return Rejected("the picture is too small") if reason is None else reason
