"""AprilGrids (Kalibr's boards): tags say which corner is which, the saddle fit says where it is.

A corner of a tag meets the corner of a small black square across the gap: together the corners make
a chessboard whose columns and rows are as wide as a tag and as a gap in turn. Every one is a
crossing of two edges, and is fitted like a chessboard's, in the cross around it that is free of
the tag's bits.

Where a corner lies follows from the numbers of several tags, never from the order in which a
library gives one tag's corners: Kalibr prints its tags half a turn away from OpenCV's drawing, and
libraries begin to count at different corners, in either direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.charuco_fit import mended, smoothed, strays
from calib.detection.refine import Fitted, doubtful, fit_grid, starts
from calib.detection.result import FloatArray, Rejected
from calib.detection.saddle import WIDTH
from calib.detection.scales import scaled
from calib.views import Board

_FEWEST_TAGS, _FEWEST_CORNERS = 2, 8
_READ_PIXELS = 2e6
_BORDERS = (2, 1)
"""Modules of a tag's black border: Kalibr prints two, AprilTag's own drawings have one."""
_FREE = 0.9
_MARGIN_WIDTHS = 3.0
"""As far from the picture's edge must a corner be, in widths of its edges."""
_MOST_SIGMA = 8.0
"""So many times the others' sigma, and too little of a corner is seen."""
_MOST_REACH = 0.4
_BLURRED = 0.6
"""Edges wider than this share of the free cross reach into the tag's bits or the next tag."""
_NEAREST = 8
_MOST_PERCENT = 90
_OFF_ORDER = 0.15
"""Of a tag's side: a wrong order of the tags is off by half a tag and more."""


@dataclass(frozen=True)
class _Read:
    """Tags that were read: numbers, (T, 4, 2) outlines in pixels, modules of their border."""

    numbers: NDArray[np.int64]
    outlines_px: FloatArray
    border: int

    def enlarged(self, scale: float) -> _Read:
        """The same in the picture of which this one is smaller by `scale`."""
        return _Read(self.numbers, (self.outlines_px + 0.5) / scale - 0.5, self.border)


@dataclass(frozen=True)
class _Expected:
    """(rows, cols, 2) where the corners must be, and how far most outlines are from there."""

    corners_px: FloatArray
    off_px: float


def find_aprilgrid(
    image: NDArray[np.float32], board: Board
) -> tuple[Fitted, NDArray[np.bool_]] | Rejected:
    """Fit all corners of an AprilGrid and say which were not seen, (rows, cols).

    Parameters
    ----------
    image:
        (h, w) grey levels.
    board:
        The board, its tags numbered from the bottom left, row by row upwards.
    """
    scale = next(s for s in (1.0, 0.5, 0.25, 0.125) if image.size * s * s <= _READ_PIXELS)
    small = scaled(image, scale)
    reads = [_read(small, board, border) for border in _BORDERS]
    most = max(len(read.numbers) for read in reads)
    if most < _FEWEST_TAGS:
        return Rejected("fewer than two of the board's tags were read")
    # tags with a border of two modules can be read as if it were one, their outlines then too small
    able = [read.enlarged(scale) for read in reads if 2 * len(read.numbers) >= most]
    found = [(read, _expected(read, board)) for read in able]
    fitting = [(e.off_px, e, read) for read, e in found if isinstance(e, _Expected)]
    if not fitting:
        return next(e for _, e in found if isinstance(e, Rejected))
    _, expected, read = min(fitting, key=lambda entry: entry[0])
    return _fitted(image, expected.corners_px, read.border, board)


def _read(image: NDArray[np.float32], board: Board, border: int) -> _Read:
    """The board's tags that OpenCV reads, those that it reads twice left out."""
    top = max(255.0, float(np.percentile(image[::5, ::5], 99.5)))
    eight_bit = np.asarray(np.clip(image * (255.0 / top), 0, 255), dtype=np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, str(board.dictionary)))
    settings = cv2.aruco.DetectorParameters()
    settings.markerBorderBits = border
    least_side_px = 2 * (dictionary.markerSize + 2 * border)
    settings.minMarkerPerimeterRate = 4 * least_side_px / max(image.shape)
    outlines, numbers, _ = cv2.aruco.ArucoDetector(dictionary, settings).detectMarkers(eight_bit)
    if numbers is None:
        return _Read(np.empty(0, np.int64), np.empty((0, 4, 2)), border)
    found = numbers.ravel().astype(np.int64)
    once = np.array([(found == n).sum() == 1 for n in found]) & (found < board.corner_count // 4)
    px = np.array(outlines, dtype=float).reshape(-1, 4, 2)
    return _Read(found[once], px[once], border)


def tag_corners(numbers: NDArray[np.int64], board: Board) -> FloatArray:
    """(T, 4, 2) places of tags' corners in squares, clockwise from the top left."""
    tags_x, tags_y = board.cols // 2, board.rows // 2
    up, along = np.divmod(numbers, tags_x)
    x, y = board.places
    left, top = x[2 * along], y[2 * (tags_y - 1 - up)]
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    return np.asarray(np.stack([left, top], axis=-1)[:, None] + corner)


def _expected(read: _Read, board: Board) -> _Expected | Rejected:
    """Where the corners must be; every way of turning the tags is tried."""
    places = tag_corners(read.numbers, board)
    fits = [_homography(np.roll(places, turn, axis=1), read.outlines_px) for turn in range(4)]
    known = [(misfit, turn, H) for turn, (misfit, H) in enumerate(fits) if H is not None]
    if not known:
        return Rejected("the tags that were read do not lie on a plane")
    misfit, turn, H = min(known, key=lambda entry: entry[0])
    side = float(np.median(np.linalg.norm(np.diff(read.outlines_px, axis=1), axis=-1)))
    if misfit > _OFF_ORDER * side:
        return Rejected(
            "the tags that were read are not where this board has them: tags_x, gap_m, or tags"
            " that are not numbered from the bottom left, row by row upwards"
        )
    lattice = np.stack(np.meshgrid(*board.places), axis=-1).reshape(-1, 2)
    expected = cv2.perspectiveTransform(lattice[None], H)[0]
    at = np.roll(places, turn, axis=1).reshape(-1, 2)
    off = read.outlines_px.reshape(-1, 2) - cv2.perspectiveTransform(at[None], H)[0]
    for m, place in enumerate(lattice):
        nearest = np.argsort(np.square(at - place).sum(axis=1))[:_NEAREST]
        expected[m] += np.median(off[nearest], axis=0)
    off_px = float(np.percentile(np.linalg.norm(off, axis=1), _MOST_PERCENT))
    return _Expected(expected.reshape(board.rows, board.cols, 2), off_px)


def _homography(places: FloatArray, outlines_px: FloatArray) -> tuple[float, Any]:
    """Median misfit in pixels, and image from board, None where there is none or a mirrored."""
    pixels = outlines_px.reshape(-1, 2)
    at = places.reshape(-1, 2)
    H, _ = cv2.findHomography(at, pixels, cv2.RANSAC, 0.02 * float(np.ptp(pixels)))
    if H is None or np.linalg.det(H) * H[2, 2] <= 0:
        return np.inf, None
    seen = cv2.perspectiveTransform(at[None], H)[0]
    return float(np.median(np.linalg.norm(seen - pixels, axis=1))), H


def _fitted(
    image: NDArray[np.float32], expected: FloatArray, border: int, board: Board
) -> tuple[Fitted, NDArray[np.bool_]] | Rejected:
    """The corners fitted from where they are expected."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, str(board.dictionary)))
    border_share = border / (dictionary.markerSize + 2 * border)
    gap_share = float(board.gap_m or 0.0) / board.square_m
    reach = min(_FREE * gap_share, _MOST_REACH)
    clear = _FREE * min(border_share, gap_share)
    places = board.places
    first = starts(image, expected, aside=0.7 * clear)
    for bent, iterations in ((False, 6), (True, 4), (True, 12)):
        fitted = fit_grid(
            image, first, bent=bent, clear=clear, iterations=iterations, places=places, reach=reach
        )
        doubt = doubtful(fitted, expected, first_dark=True) | _vague(fitted, image.shape)
        doubt |= strays(fitted.corners_px, doubt, places)
        seen = int((~doubt).sum())
        if seen < _FEWEST_CORNERS:
            return Rejected(f"only {seen} of {doubt.size} corners are clear")
        # a corner that is guessed badly would bend the lines of those around it
        line = smoothed(fitted.corners_px, doubt, places)
        first = mended(fitted, doubt, expected if line is None else line)
    side_px = float(np.median(np.linalg.norm(np.diff(expected, axis=1)[:, ::2], axis=-1)))
    if float(np.median(fitted.parameters[~doubt][:, WIDTH])) > _BLURRED * clear * side_px:
        return Rejected("too blurred to distinguish the corners from the tags' bits")
    return fitted, doubt


def _vague(fitted: Fitted, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """(rows, cols) corners outside the picture, or of which too little is in it."""
    corners = fitted.corners_px
    margin = _MARGIN_WIDTHS * float(np.nanmedian(fitted.parameters[..., WIDTH]))
    size = np.array(shape[1::-1])
    outside = ((corners < margin) | (corners > size - 1 - margin)).any(axis=2)
    sigma = np.sqrt(np.trace(fitted.covariance_px2, axis1=2, axis2=3) / 2)
    with np.errstate(invalid="ignore"):
        return np.asarray(outside | ~(sigma < _MOST_SIGMA * np.nanmedian(sigma)))
