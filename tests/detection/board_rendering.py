"""A renderer of its own for the detector's tests: truth by supersampling, none of the fit's erf."""

from __future__ import annotations

from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@numba.njit(cache=True)
def _bent_back(
    x: float, y: float, k1: float, f: float, cx: float, cy: float
) -> tuple[float, float]:
    xd, yd = (x - cx) / f, (y - cy) / f
    xu, yu = xd, yd
    for _ in range(8):
        r2 = xu * xu + yu * yu
        xu, yu = xd / (1 + k1 * r2), yd / (1 + k1 * r2)
    return xu * f + cx, yu * f + cy


@numba.njit(cache=True)
def _render(
    height: int, width: int, H: Any, rows: int, cols: int, k1: float, f: float, samples: int
) -> Any:
    image = np.zeros((height, width), dtype=np.float32)
    cx, cy = 0.5 * (width - 1), 0.5 * (height - 1)
    for v in range(height):
        for u in range(width):
            total = 0.0
            for a in range(samples):
                for b in range(samples):
                    x, y = u + (a + 0.5) / samples - 0.5, v + (b + 0.5) / samples - 0.5
                    if k1 != 0.0:
                        x, y = _bent_back(x, y, k1, f, cx, cy)
                    w = H[2, 0] * x + H[2, 1] * y + H[2, 2]
                    p = (H[0, 0] * x + H[0, 1] * y + H[0, 2]) / w
                    q = (H[1, 0] * x + H[1, 1] * y + H[1, 2]) / w
                    inside = -1.0 <= p < cols and -1.0 <= q < rows
                    margin = -1.6 <= p < cols + 0.6 and -1.6 <= q < rows + 0.6
                    if inside:
                        total += float((int(p + 2) + int(q + 2)) % 2)
                    elif margin:
                        total += 1.0
                    else:
                        total += 0.4
            image[v, u] = total / (samples * samples)
    return image


def pose_homography(
    rows: int,
    cols: int,
    *,
    square_px: float,
    centre: tuple[float, float],
    tilt_deg: float = 0.0,
    azimuth_deg: float = 0.0,
    roll_deg: float = 0.0,
    f_px: float = 1500.0,
) -> FloatArray:
    """Image from lattice coordinates (col, row) of a board tilted about its middle.

    `square_px` is the size of a square at the board's middle before the tilt.
    """
    tilt, azimuth, roll = np.deg2rad([tilt_deg, azimuth_deg, roll_deg])
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    R = cv2.Rodrigues(tilt * axis)[0] @ cv2.Rodrigues(np.array([0, 0, roll]))[0]
    distance = f_px / square_px
    middle = np.array([[1, 0, -(cols - 1) / 2], [0, 1, -(rows - 1) / 2], [0, 0, 1.0]])
    extrinsic = np.column_stack([R[:, 0], R[:, 1], [0, 0, distance]])
    K = np.array([[f_px, 0, centre[0]], [0, f_px, centre[1]], [0, 0, 1]])
    return np.asarray(K @ extrinsic @ middle)


def render_board(
    shape: tuple[int, int],
    image_from_lattice: FloatArray,
    rows: int,
    cols: int,
    *,
    blur_px: float = 0.0,
    contrast: float = 160.0,
    dark: float = 45.0,
    k1: float = 0.0,
    shading: float = 0.0,
    samples: int = 8,
) -> tuple[FloatArray, FloatArray]:
    """A noise-free picture of a chessboard, and its true corners.

    The square outside corner (0, 0) is dark. `shading` is the relative fall of the light from
    left to right. Blur is a Gaussian on the pixel grid, exact enough from about 0.8 px on.

    Returns
    -------
    (h, w) grey levels, not rounded; (rows * cols, 2) true corners in pixels.
    """
    height, width = shape
    f = float(max(shape))
    inverse = np.linalg.inv(image_from_lattice)
    image = dark + contrast * _render(height, width, inverse, rows, cols, k1, f, samples)
    image *= 1 - shading * np.linspace(-0.5, 0.5, width, dtype=np.float32)
    if blur_px > 0:
        size = 2 * int(6 * blur_px + 2) + 1
        image = cv2.GaussianBlur(image, (size, size), blur_px)
    places = np.argwhere(np.ones((rows, cols)))[:, ::-1].astype(float)
    truth = cv2.perspectiveTransform(places[None], image_from_lattice)[0]
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    r2 = np.square((truth - centre) / f).sum(axis=1, keepdims=True)
    return image.astype(float), np.asarray(centre + (truth - centre) * (1 + k1 * r2))


def photograph(image: FloatArray, *, noise: float = 2.0, seed: int = 0) -> NDArray[np.uint8]:
    """The picture with Gaussian noise, rounded to 8 bits."""
    noisy = image + np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def localisation_bound_px(
    image: FloatArray, truth_px: FloatArray, rows: int, cols: int, noise: float
) -> float:
    """The best RMS per axis with which noise lets the corners be found, pixels.

    Cramer-Rao for a known pattern: moving it by dx changes a pixel by its gradient times dx.
    The pixels within 0.4 squares of the corner along both lattice directions count.
    """
    gy, gx = np.gradient(image)
    grid = truth_px.reshape(rows, cols, 2)
    across, down = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    variances = []
    for corner, e1, e2 in zip(
        grid.reshape(-1, 2), across.reshape(-1, 2), down.reshape(-1, 2), strict=True
    ):
        half = 0.4 * (np.abs(e1) + np.abs(e2)) + 1
        (x0, y0), (x1, y1) = (corner - half).astype(int), (corner + half).astype(int) + 1
        x, y = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
        offset = np.stack([x, y], axis=-1).reshape(-1, 2) - corner
        inside = (np.abs(offset @ np.linalg.inv([e1, e2])) <= 0.4).all(axis=1)
        slope = np.stack([gx[y, x], gy[y, x]], axis=-1).reshape(-1, 2)[inside]
        variances.append(np.diag(np.linalg.inv(slope.T @ slope)))
    return float(noise * np.sqrt(np.mean(variances)))


def best_order_px(found_px: FloatArray, truth_px: FloatArray, rows: int, cols: int) -> FloatArray:
    """(M, 2) error of the found corners in the unmirrored order that suits the truth best."""
    grid = found_px.reshape(rows, cols, 2)
    turns = (0, 1, 2, 3) if rows == cols else (0, 2)
    errors = [np.rot90(grid, turn).reshape(-1, 2) - truth_px for turn in turns]
    return min(errors, key=lambda error: float(np.square(error).sum()))
