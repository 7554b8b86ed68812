"""From a rough grid to maximum-likelihood corners: starts, windows and what is given."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.result import FloatArray
from calib.detection.saddle import (
    ANGLE_1,
    ANGLE_2,
    CONTRAST,
    MEAN,
    NO_MARKS,
    PARAMETERS,
    PIXEL_VARIANCE,
    WIDTH,
    X,
    Y,
    fit_corners,
)

# blur as a share of a square from which on neighbouring corners reach into the window
_MIXING_BLUR = 0.17
_VAGUE_BLUR = 0.1


@dataclass(frozen=True)
class Fitted:
    """A grid's fitted corners.

    Attributes
    ----------
    parameters:
        (rows, cols, 7) as `saddle.fit_corners` returns them; contrast is half the step and
        positive where the square between the directions of rows and columns is dark.
    covariance_px2:
        (rows, cols, 2, 2).
    residual:
        (rows, cols) standard deviation in grey levels; NaN where the fit broke down.
    """

    parameters: FloatArray
    covariance_px2: FloatArray
    residual: FloatArray

    @property
    def corners_px(self) -> FloatArray:
        """(rows, cols, 2) positions."""
        return self.parameters[..., [X, Y]]

    @property
    def first_dark_contrast(self) -> FloatArray:
        """(rows, cols) contrast, positive everywhere if the square outside (0, 0) is dark."""
        rows, cols = self.residual.shape
        odd = np.add.outer(np.arange(rows), np.arange(cols)) % 2
        return np.asarray(self.parameters[..., CONTRAST] * (1 - 2 * odd))

    @property
    def blur_px(self) -> FloatArray:
        """(rows, cols) Gaussian blur without the pixel's own."""
        width = self.parameters[..., WIDTH]
        return np.asarray(np.sqrt(np.maximum(width**2 - PIXEL_VARIANCE, 0)))


Places = tuple[FloatArray, FloatArray]
"""(cols,) and (rows,) where the lattice's columns and rows stand, where not one unit apart."""


def _gradient(values: FloatArray, axis: int, places: Places | None) -> FloatArray:
    """By one unit of the lattice along its rows (0) or columns (1)."""
    if places is None:
        return np.asarray(np.gradient(values, axis=axis))
    return np.asarray(np.gradient(values, places[1 - axis], axis=axis))


def lattice_steps(corners_px: FloatArray, places: Places | None = None) -> FloatArray:
    """(rows, cols, 4) image step of one column (2) and of one row (2) at each corner."""
    along_cols = _gradient(corners_px, 1, places)
    along_rows = _gradient(corners_px, 0, places)
    return np.concatenate([along_cols, along_rows], axis=-1)


def shortest_step(steps: FloatArray) -> FloatArray:
    sides = np.linalg.norm(steps.reshape(*steps.shape[:-1], 2, 2), axis=-1)
    return np.asarray(sides.min(axis=-1))


def _sampled(image: NDArray[np.float32], xy: FloatArray) -> FloatArray:
    x = np.clip(np.rint(xy[..., 0]).astype(int), 0, image.shape[1] - 1)
    y = np.clip(np.rint(xy[..., 1]).astype(int), 0, image.shape[0] - 1)
    return np.asarray(image[y, x], dtype=np.float64)


def edge_angles(corners_px: FloatArray) -> FloatArray:
    """(rows, cols, 2) directions of the lattice's two lines at each corner, radians."""
    steps = lattice_steps(corners_px)
    return np.arctan2(steps[..., 1::2], steps[..., 0::2])


def starts(
    image: NDArray[np.float32], corners_px: FloatArray, *, aside: float = 0.35
) -> FloatArray:
    """(rows, cols, 7) first guesses: edges along the lattice, levels from the squares.

    The levels are read `aside` of the corner, as a share of the steps in both directions.
    """
    steps = lattice_steps(corners_px)
    across, down = steps[..., :2], steps[..., 2:]
    quarters = [
        (a, b, _sampled(image, corners_px + aside * (a * across + b * down)))
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    guess = np.empty((*corners_px.shape[:2], PARAMETERS))
    guess[..., [X, Y]] = corners_px
    guess[..., [ANGLE_1, ANGLE_2]] = edge_angles(corners_px)
    guess[..., WIDTH] = np.maximum(0.06 * shortest_step(steps), 0.8)
    guess[..., MEAN] = sum(level for _, _, level in quarters) / 4
    # d1 > 0 below edge 1 and d2 > 0 left of edge 2: their product is negative in square (+, +)
    guess[..., CONTRAST] = -sum(a * b * level for a, b, level in quarters) / 4
    return guess


def enlarged(first: FloatArray, scale: float) -> FloatArray:
    """Fit parameters of an image that is smaller by `scale`, as starts on the full one."""
    starts_full = first.copy()
    starts_full[..., [X, Y]] = (first[..., [X, Y]] + 0.5) / scale - 0.5
    blur2 = np.maximum(first[..., WIDTH] ** 2 - PIXEL_VARIANCE, 0.05) / scale**2
    starts_full[..., WIDTH] = np.sqrt(blur2 + PIXEL_VARIANCE)
    return starts_full


def _image_gradient(
    values: FloatArray, steps: FloatArray, places: Places | None, *, vague: bool
) -> FloatArray:
    """(rows, cols, 2) image gradient of a quantity known at the corners.

    `vague` values are first smoothed over the whole board.
    """
    values = quadratic(values) if vague else values
    by_col = _gradient(values, 1, places)
    by_row = _gradient(values, 0, places)
    det = steps[..., 0] * steps[..., 3] - steps[..., 1] * steps[..., 2]
    gx = (by_col * steps[..., 3] - by_row * steps[..., 1]) / det
    gy = (by_row * steps[..., 0] - by_col * steps[..., 2]) / det
    return np.stack([gx, gy], axis=-1)


def quadratic(values: FloatArray) -> FloatArray:
    """The values, some of them NaN, replaced by the quadratic surface through them."""
    row, col = np.meshgrid(*(np.linspace(-1, 1, n) for n in values.shape), indexing="ij")
    basis = np.stack([np.ones_like(row), row, col, row * row, row * col, col * col], axis=-1)
    basis = basis.reshape(-1, 6)
    known = np.isfinite(values.reshape(-1))
    weights = np.linalg.lstsq(basis[known], values.reshape(-1)[known], rcond=None)[0]
    return np.asarray((basis @ weights).reshape(values.shape))


def _curvature(corners_px: FloatArray, axis: int, places: Places | None) -> FloatArray:
    """(rows, cols) bend of the lattice line along `axis`, 1/pixel, positive towards its normal.

    A lens bends lines more and more away from its axis: the surface of second order through
    the second differences, which the outermost corners lack.
    """
    line = np.moveaxis(corners_px, axis, 0)
    bend = np.full(line.shape[:2], np.nan)
    if len(line) >= 3:
        at = np.arange(len(line)) if places is None else places[1 - axis]
        back, ahead = np.diff(at)[:-1, None, None], np.diff(at)[1:, None, None]
        before, after = (line[1:-1] - line[:-2]) / back, (line[2:] - line[1:-1]) / ahead
        step = (ahead * before + back * after) / (back + ahead)
        second = 2 * (after - before) / (back + ahead)
        turning = step[..., 0] * second[..., 1] - step[..., 1] * second[..., 0]
        bend[1:-1] = turning / np.linalg.norm(step, axis=-1) ** 3
    return quadratic(np.moveaxis(bend, 0, axis))


def _blur_share(parameters: FloatArray) -> float:
    """The typical edge width as a share of a square's shorter side."""
    shortest = shortest_step(lattice_steps(parameters[..., [X, Y]]))
    return float(np.nanmedian(parameters[..., WIDTH] / shortest))


def _shapes(fitted: FloatArray | None, steps: FloatArray, places: Places | None) -> FloatArray:
    """(rows, cols, 6) what `saddle.fit_corners` takes as given, from an earlier fit if any."""
    shapes = np.zeros((*steps.shape[:2], 6))
    if fitted is not None:
        # wide blur leaves each corner's own levels too vague for differences between them
        vague = _blur_share(fitted) > _VAGUE_BLUR
        size, sign = np.abs(fitted[..., CONTRAST]), np.sign(fitted[..., CONTRAST])
        shapes[..., 0:2] = _image_gradient(fitted[..., MEAN], steps, places, vague=vague)
        shapes[..., 2:4] = sign[..., None] * _image_gradient(size, steps, places, vague=vague)
        shapes[..., 4] = _curvature(fitted[..., [X, Y]], 1, places)
        shapes[..., 5] = _curvature(fitted[..., [X, Y]], 0, places)
    return shapes


def extended(corners_px: FloatArray, places: Places | None = None) -> FloatArray:
    """One more ring of lattice points around, where a homography through the others has them.

    Where the lattice is not even, the ring is as far away as the second next lines are apart.
    """
    rows, cols = corners_px.shape[:2]
    across, down = places or (np.arange(cols, dtype=float), np.arange(rows, dtype=float))
    x, y = (_one_more(at) for at in (across, down))
    place = np.stack(np.meshgrid(x, y), axis=-1)
    inner = place[1:-1, 1:-1].reshape(-1, 2)
    H, _ = cv2.findHomography(inner, corners_px.reshape(-1, 2))
    expected = cv2.perspectiveTransform(place.reshape(1, -1, 2), H).reshape(place.shape)
    misfit = corners_px - expected[1:-1, 1:-1]
    return np.asarray(expected + np.pad(misfit, ((1, 1), (1, 1), (0, 0)), mode="edge"))


def _one_more(at: FloatArray) -> FloatArray:
    """Places with one more before and after: an even lattice goes on, of two steps both recur."""
    first, last = (at[2] - at[1], at[-2] - at[-3]) if len(at) > 2 else (at[1] - at[0],) * 2
    return np.concatenate([[at[0] - first], at, [at[-1] + last]])


def _neighbour_lines(corners_px: FloatArray, places: Places | None) -> FloatArray:
    """(rows, cols, 4, 4) the `lines` of `saddle.fit_corners`."""
    rows, cols = corners_px.shape[:2]
    around = extended(corners_px, places)
    steps = lattice_steps(around)
    lines = np.ones((rows, cols, 4, 4))
    # edge 1 has its normal down the rows, edge 2 against the columns
    for k, (down, right) in enumerate(((1, 0), (-1, 0), (0, -1), (0, 1))):
        part = (slice(1 + down, 1 + down + rows), slice(1 + right, 1 + right + cols))
        along = steps[part][..., :2] if k < 2 else steps[part][..., 2:]
        normal = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        lines[..., k, :2] = normal
        lines[..., k, 2] = (normal * around[part]).sum(axis=-1)
    lines[-1, :, 0, 3] = lines[0, :, 1, 3] = lines[:, 0, 2, 3] = lines[:, -1, 3, 3] = 0.0
    return lines


def fit_grid(
    image: NDArray[np.float32],
    first: FloatArray,
    *,
    bent: bool = False,
    clear: float = 1.0,
    iterations: int = 12,
    marks: NDArray[np.float32] = NO_MARKS,
    places: Places | None = None,
    reach: float = 0.4,
) -> Fitted:
    """Fit all corners of a grid from (rows, cols, 7) starts.

    With `bent`, the starts are taken to be good enough to read from them the shading over the
    board and the bend of its lines in the image, which the fit then takes as given.
    """
    rows, cols = first.shape[:2]
    steps = lattice_steps(first[..., [X, Y]], places)
    shapes = _shapes(first if bent else None, steps, places)
    parameters, covariance, residual = fit_corners(
        image,
        first.reshape(-1, PARAMETERS),
        steps.reshape(-1, 4),
        shapes.reshape(-1, 6),
        _neighbour_lines(first[..., [X, Y]], places).reshape(-1, 4, 4),
        reach=reach,
        clear=clear,
        iterations=iterations,
        marks=marks,
    )
    return Fitted(
        parameters.reshape(rows, cols, PARAMETERS),
        covariance.reshape(rows, cols, 2, 2),
        residual.reshape(rows, cols),
    )


def fit_closely(
    image: NDArray[np.float32], first: FloatArray, *, rough: bool, clear: float = 1.0
) -> Fitted:
    """The last word on a grid: starts refined if `rough`, then the fit with all that bends.

    Where the blur mixes neighbouring corners, a first fit says more about the neighbours.
    """
    if rough:
        first = fit_grid(image, first, clear=clear, iterations=2).parameters
    if _blur_share(first) > _MIXING_BLUR:
        first = fit_grid(image, first, bent=True, clear=clear, iterations=1).parameters
    return fit_grid(image, first, bent=True, clear=clear)


def doubtful(fitted: Fitted, before_px: FloatArray, first_dark: bool) -> NDArray[np.bool_]:
    """(rows, cols) corners that are no crossing of the expected colours where expected.

    Parameters
    ----------
    before_px:
        (rows, cols, 2) where the corners were before the fit.
    first_dark:
        Whether the square outside corner (0, 0) is dark.
    """
    if not np.isfinite(fitted.residual).any():
        return np.ones(fitted.residual.shape, dtype=np.bool_)
    shortest = shortest_step(lattice_steps(before_px))
    moved = np.linalg.norm(fitted.corners_px - before_px, axis=-1)
    contrast = fitted.first_dark_contrast * (1.0 if first_dark else -1.0)
    # of the corners that are there: half of a board may be out of the picture
    strength = np.abs(contrast)
    there = strength > 0.3 * float(np.nanquantile(strength, 0.9))
    typical = float(np.median(strength[there])) if there.any() else 0.0
    fine = (
        np.isfinite(fitted.residual)
        & (moved < 0.3 * shortest)
        & (contrast > 0.2 * typical)
        & (contrast < 1.5 * typical)
        & (fitted.residual < 0.12 * typical + 2.5 * float(np.nanmedian(fitted.residual)))
    )
    return np.asarray(~fine)
