"""Places that look like the crossing of two edges: the finder's raw material.

A chessboard corner is a saddle of the smoothed image, so the negated Hessian determinant peaks
there whatever the rotation, tilt or blur of the board; a circle around the peak then shows two
dark and two bright sectors, which gives the directions of the edges and which squares are dark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_CIRCLE_SAMPLES = 32
_CIRCLE_STEP_RAD = 2 * math.pi / _CIRCLE_SAMPLES
_WIDEST_BEND_RAD = 0.6
_NARROWEST_SECTOR_RAD = 0.22


@dataclass(frozen=True)
class Candidates:
    """Possible corners of one image.

    Attributes
    ----------
    xy:
        (K, 2) pixels.
    rays_rad:
        (K, 4) directions of the four edges that leave the corner, ascending around it; the
        sector after ray 0 (towards larger angles) and the one after ray 2 are dark.
    """

    xy: FloatArray
    rays_rad: FloatArray

    def __len__(self) -> int:
        return len(self.xy)


def saddle_strength(smooth: NDArray[np.float32]) -> NDArray[np.float32]:
    """(h, w) negated determinant of the Hessian; positive at saddles."""
    mixed = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, ksize=3, scale=0.25)
    across = cv2.Sobel(smooth, cv2.CV_32F, 2, 0, ksize=3, scale=0.25)
    down = cv2.Sobel(smooth, cv2.CV_32F, 0, 2, ksize=3, scale=0.25)
    return np.asarray(mixed * mixed - across * down, dtype=np.float32)


def _peaks(strength: NDArray[np.float32], most: int) -> NDArray[np.float64]:
    border = 4
    summit = cv2.dilate(strength, np.ones((3, 3), np.uint8))
    y, x = np.nonzero((strength == summit) & (strength > 1e-3 * float(strength.max())))
    inside = (
        (x >= border)
        & (y >= border)
        & (x < strength.shape[1] - border)
        & (y < strength.shape[0] - border)
    )
    x, y = x[inside], y[inside]
    if len(x) > most:
        strongest = np.argpartition(strength[y, x], -most)[-most:]
        x, y = x[strongest], y[strongest]
    return np.stack([_summit(strength, y, x, 0, 1), _summit(strength, y, x, 1, 0)], axis=1)


def _summit(strength: NDArray[np.float32], y: Any, x: Any, dy: int, dx: int) -> FloatArray:
    before, here, after = strength[y - dy, x - dx], strength[y, x], strength[y + dy, x + dx]
    bend = before - 2 * here + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, 1), 0)
    return np.asarray((x if dx else y) + np.clip(shift, -0.5, 0.5), dtype=np.float64)


@numba.njit(cache=True)
def _is_cross(ray: Any) -> bool:
    """Whether opposite rays nearly make a line and no sector is a sliver."""
    for i in range(2):
        if abs(ray[i + 2] - ray[i] - math.pi) > _WIDEST_BEND_RAD:
            return False
    for i in range(3):
        if ray[i + 1] - ray[i] < _NARROWEST_SECTOR_RAD:
            return False
    return bool(ray[0] + 2 * math.pi - ray[3] >= _NARROWEST_SECTOR_RAD)


@numba.njit(cache=True)
def _sample_ring(image: Any, x0: float, y0: float, radius: float, ring: Any) -> None:
    for i in range(_CIRCLE_SAMPLES):
        angle = i * _CIRCLE_STEP_RAD
        x, y = x0 + radius * math.cos(angle), y0 + radius * math.sin(angle)
        ix, iy = int(x), int(y)
        fx, fy = x - ix, y - iy
        upper = image[iy, ix] * (1 - fx) + image[iy, ix + 1] * fx
        lower = image[iy + 1, ix] * (1 - fx) + image[iy + 1, ix + 1] * fx
        ring[i] = upper * (1 - fy) + lower * fy


@numba.njit(cache=True)
def _four_crossings(ring: Any, middle: float, ray: Any) -> bool:
    """Where the ring crosses its middle level; `ray` starts with a fall into the dark."""
    crossings, first_falls = 0, False
    for i in range(_CIRCLE_SAMPLES):
        here, after = ring[i] - middle, ring[(i + 1) % _CIRCLE_SAMPLES] - middle
        if (here > 0) == (after > 0):
            continue
        if crossings == 4:
            return False
        ray[crossings] = (i + here / (here - after)) * _CIRCLE_STEP_RAD
        first_falls = first_falls or (crossings == 0 and here > 0)
        crossings += 1
    if crossings == 4 and not first_falls:
        last = ray[3] - 2 * math.pi
        ray[3], ray[2], ray[1] = ray[2], ray[1], ray[0]
        ray[0] = last
    return crossings == 4


@numba.njit(cache=True, nogil=True)
def _rays(image: Any, xy: Any, radius: float, least_amplitude: float) -> tuple[Any, Any]:
    """The four edge directions at each place, and whether the circle has four sectors there."""
    K = xy.shape[0]
    rays = np.empty((K, 4))
    good = np.zeros(K, dtype=np.bool_)
    height, width = image.shape
    ring = np.empty(_CIRCLE_SAMPLES)
    for k in range(K):
        x0, y0 = xy[k]
        if min(x0, y0) < radius + 1 or x0 > width - radius - 2 or y0 > height - radius - 2:
            continue
        _sample_ring(image, x0, y0, radius, ring)
        low, high = ring.min(), ring.max()
        if high - low > least_amplitude and _four_crossings(ring, 0.5 * (low + high), rays[k]):
            good[k] = _is_cross(rays[k])
    return rays, good


def find_candidates(
    image: NDArray[np.float32], *, sigma_px: float = 1.2, radius_px: float = 3.5, most: int = 8000
) -> Candidates:
    """Crossings of two edges in an image.

    Parameters
    ----------
    image:
        (h, w) grey levels.
    sigma_px:
        Gaussian smoothing before differentiation.
    radius_px:
        Radius of the circle that must show four sectors; squares must be larger than this.
    most:
        Only so many of the strongest saddles are looked at.
    """
    smooth = np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), dtype=np.float32)
    xy = _peaks(saddle_strength(smooth), most)
    spread = float(np.subtract(*np.percentile(smooth[::7, ::7], [99, 1])))
    rays, good = _rays(smooth, xy, radius_px, 0.06 * spread)
    return Candidates(xy[good], rays[good])
