"""A ChArUco board's corners fitted from where they are expected, and which of them are there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.grid import Grid
from calib.detection.markers import Placement, place_by_markers
from calib.detection.marks import drawn_marks
from calib.detection.refine import (
    Fitted,
    Places,
    doubtful,
    edge_angles,
    enlarged,
    extended,
    fit_closely,
    fit_grid,
    lattice_steps,
    quadratic,
    shortest_step,
    starts,
)
from calib.detection.result import FloatArray, Rejected
from calib.detection.saddle import ANGLE_1, ANGLE_2, CONTRAST, WIDTH, X, Y
from calib.detection.scales import scaled
from calib.views import Board

FEWEST_CORNERS = 6
"""Below this a ChArUco board does not count as seen."""

# edges wider than this share of the free strip beside them reach into the markers
_CROWDED = 0.25
_STRAY_SQUARES = 0.1
_MOST_PASSES = 12
_IN_LINE_PX = 0.01
_SMALL_SQUARE_PX = 12
_TOO_BLURRED = "too blurred to distinguish the corners from the markers"
_MARGIN_PX = 8


@dataclass(frozen=True)
class Guess:
    """Where a board's corners are expected.

    Attributes
    ----------
    corners_px:
        (rows, cols, 2) pixels.
    layout:
        Which of the board's `layouts` it has, where the markers show it.
    """

    corners_px: FloatArray
    layout: int | None = None

    def enlarged(self, scale: float) -> Guess:
        """The same in the picture of which this one is smaller by `scale`."""
        return Guess((self.corners_px + 0.5) / scale - 0.5, self.layout)


@dataclass(frozen=True)
class Seen:
    """A board's fitted corners.

    Attributes
    ----------
    fitted, unseen:
        All corners, and (rows, cols) which of them are not there.
    named_by_markers:
        Whether the markers between the corners were seen to be the right ones.
    """

    fitted: Fitted
    unseen: NDArray[np.bool_]
    named_by_markers: bool

    def rank(self) -> tuple[bool, int]:
        """The better, the higher."""
        return self.named_by_markers, int((~self.unseen).sum())

    def share_seen(self, shape: tuple[int, ...]) -> float:
        """Of the corners within a picture of this shape."""
        corners = self.fitted.corners_px
        inside = ((corners >= 0) & (corners <= np.array(shape[1::-1]) - 1)).all(axis=2)
        return float((~self.unseen).sum() / max(1, inside.sum()))


def fit_charuco(image: NDArray[np.float32], guess: Guess, board: Board) -> Seen | Rejected:
    """Fit all corners from where they are expected, and doubt those that are not there.

    Sharp corners are fitted in the cross that runs free of print between the markers. Where the
    blur carries the markers into that cross, or it is narrower than two pixels or so, they are
    drawn into the model, and the whole window is used.
    """
    expected = guess.corners_px
    clear = 0.45 * (1 - _marker_share(board))
    start = starts(image, expected, aside=0.7 * clear)
    even_dark = float(np.nanmedian(_of_even_corner(start))) > 0
    first = fit_grid(image, start, clear=clear, iterations=6)
    doubt = doubtful(first, expected, even_dark)
    doubt |= strays(first.corners_px, doubt)
    layout = guess.layout
    if layout is None:
        place = _named(image, first.corners_px, doubt, even_dark, board)
        place = place or place_by_markers(image, Grid(expected, even_dark), board)
        layout = None if place is None or any(place.where) else place.layout
    if layout is not None and _crowding(first, expected, board) > _CROWDED:
        agreed = _fit_with_marks(image, start, even_dark, board, layout)
        if isinstance(agreed, Rejected):
            return agreed
        fine, line = agreed
        doubt = doubtful(fine, line, even_dark)
    elif (~doubt).sum() < FEWEST_CORNERS:
        return Rejected(f"only {int((~doubt).sum())} of {doubt.size} corners are seen")
    else:
        fine = fit_closely(image, mended(first, doubt, expected), rough=True, clear=clear)
        doubt |= doubtful(fine, expected, even_dark)
    doubt |= strays(fine.corners_px, doubt)
    if (~doubt).sum() < FEWEST_CORNERS:
        return Rejected(f"only {int((~doubt).sum())} of {doubt.size} corners are clear")
    place = _named(image, fine.corners_px, doubt, even_dark, board)
    if (place is not None and any(place.where)) or (place is None and guess.layout is not None):
        # a homography from two markers can miss by a whole square, where the next corner fits
        return Rejected("the markers do not say that the corners are what they seem")
    return Seen(fine, doubt, place is not None)


def _named(
    image: NDArray[np.float32],
    corners_px: FloatArray,
    doubt: NDArray[np.bool_],
    even_dark: bool,
    board: Board,
) -> Placement | None:
    """What the markers between the corners that are there say of where these are."""
    known = np.where(doubt[..., None], np.nan, corners_px)
    return place_by_markers(image, Grid(known, even_dark), board)


def _of_even_corner(parameters: FloatArray) -> FloatArray:
    """(rows, cols) contrasts, positive everywhere if the square outside (0, 0) is dark."""
    blank = np.empty(parameters.shape[:2])
    return Fitted(parameters, blank, blank).first_dark_contrast


def _crowding(first: Fitted, expected: FloatArray, board: Board) -> float:
    """The typical edge width, and half a pixel, as a share of the strip up to the next marker."""
    strips = shortest_step(lattice_steps(expected)) * (1 - _marker_share(board)) / 2
    return float(np.median((first.parameters[..., WIDTH] + 0.5) / strips))


def _marker_share(board: Board) -> float:
    """Side of a marker as a share of a square's."""
    return (board.marker_m or 0.0) / board.square_m


def mended(fitted: Fitted, doubt: NDArray[np.bool_], expected_px: FloatArray) -> FloatArray:
    """Fit parameters with the unseen corners where expected, and of typical looks."""
    parameters = fitted.parameters.copy()
    parameters[doubt] = np.median(parameters[~doubt], axis=0)
    parameters[doubt, X], parameters[doubt, Y] = expected_px[doubt].T
    parameters[doubt, ANGLE_1 : ANGLE_2 + 1] = edge_angles(parameters[..., [X, Y]])[doubt]
    odd = np.add.outer(np.arange(doubt.shape[0]), np.arange(doubt.shape[1])) % 2
    typical = np.median(fitted.first_dark_contrast[~doubt])
    parameters[doubt, CONTRAST] = (typical * (1 - 2 * odd))[doubt]
    return parameters


def _fit_with_marks(
    image: NDArray[np.float32], first: FloatArray, even_dark: bool, board: Board, layout: int
) -> tuple[Fitted, FloatArray] | Rejected:
    """The fit with the markers drawn into its model, and where the board as a whole lies.

    Only the part of the picture that matters is looked at; where the markers lie is found on a
    smaller picture of it.
    """
    around = extended(first[..., [X, Y]])
    limits = np.array(image.shape[::-1])
    low = np.clip(np.floor(around.min(axis=(0, 1))) - _MARGIN_PX, 0, limits - 1).astype(int)
    high = np.clip(np.ceil(around.max(axis=(0, 1))) + _MARGIN_PX, low + 1, limits).astype(int)
    part = np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]])
    square = float(np.median(shortest_step(lattice_steps(first[..., [X, Y]]))))
    scale = 1.0
    while square * scale >= 2 * _SMALL_SQUARE_PX:
        scale /= 2
    parameters = first.copy()
    parameters[..., [X, Y]] -= low
    small, start = scaled(part, scale), enlarged(parameters, 1 / scale)
    agreed = _with_markers_in_line(small, start, even_dark, board, layout)
    if agreed is None:
        return Rejected(_TOO_BLURRED)
    parameters = enlarged(agreed, scale)
    for iterations in (4, 12):
        line = parameters[..., [X, Y]].copy()
        marks = _marks(part, parameters, board, layout)
        fitted = fit_grid(part, parameters, bent=True, marks=marks, iterations=iterations)
        agreed = _in_line(fitted, doubtful(fitted, line, even_dark))
        if agreed is None:
            return Rejected(_TOO_BLURRED)
        parameters = agreed
    fitted.parameters[..., [X, Y]] += low
    return fitted, line + low


def _with_markers_in_line(
    image: NDArray[np.float32], first: FloatArray, even_dark: bool, board: Board, layout: int
) -> FloatArray | None:
    """Fit parameters with the corners in line; None where fit and markers come to no agreement."""
    parameters = first
    for _ in range(_MOST_PASSES):
        before = parameters[..., [X, Y]]
        marks = _marks(image, parameters, board, layout)
        fitted = fit_grid(image, parameters, bent=True, marks=marks, iterations=4)
        doubt = doubtful(fitted, before, even_dark)
        in_line = _in_line(fitted, doubt)
        if in_line is None:
            return None
        parameters = in_line
        if np.abs(parameters[..., [X, Y]] - before).max() < _IN_LINE_PX:
            return parameters
    return None


def _in_line(fitted: Fitted, doubt: NDArray[np.bool_]) -> FloatArray | None:
    """Fit parameters with all corners where the sure ones say that the board is."""
    line = smoothed(fitted.corners_px, doubt)
    if line is None:
        return None
    parameters = mended(fitted, doubt, line)
    parameters[..., [X, Y]] = line
    return parameters


def _marks(
    image: NDArray[np.float32], parameters: FloatArray, board: Board, layout: int
) -> NDArray[np.float32]:
    blank = np.empty(parameters.shape[:2])
    sigma = float(np.median(Fitted(parameters, blank, blank).blur_px))
    around = extended(parameters[..., [X, Y]])
    return drawn_marks((image.shape[0], image.shape[1]), around, board, layout, sigma)


def smoothed(
    corners_px: FloatArray, doubt: NDArray[np.bool_], places: Places | None = None
) -> FloatArray | None:
    """(rows, cols, 2) corners in line: a homography, and how a lens bends it smoothly.

    None where too few of the corners are sure.
    """
    rows, cols = doubt.shape
    if (~doubt).sum() < FEWEST_CORNERS:
        return None
    across = places or (np.arange(cols, dtype=float), np.arange(rows, dtype=float))
    place = np.stack(np.meshgrid(*across), axis=-1).reshape(-1, 2)
    pixels = corners_px.reshape(-1, 2)
    known = ~doubt.reshape(-1)
    square = float(np.median(shortest_step(lattice_steps(corners_px))[~doubt]))
    H, inliers = cv2.findHomography(place[known], pixels[known], cv2.RANSAC, 0.25 * square)
    if H is None:
        return None
    straight = cv2.perspectiveTransform(place[None], H)[0].reshape(rows, cols, 2)
    sound = known.copy()
    sound[known] = inliers.ravel() > 0
    misfit = np.where(sound.reshape(rows, cols, 1), corners_px - straight, np.nan)
    return np.asarray(straight + np.stack([quadratic(misfit[..., k]) for k in (0, 1)], axis=-1))


def strays(
    corners_px: FloatArray, doubt: NDArray[np.bool_], places: Places | None = None
) -> NDArray[np.bool_]:
    """(rows, cols) corners that are clearly out of line with the others."""
    line = smoothed(corners_px, doubt, places)
    if line is None:
        return np.zeros_like(doubt)
    off = np.linalg.norm(corners_px - line, axis=-1)
    return np.asarray(off > _STRAY_SQUARES * shortest_step(lattice_steps(line)))
