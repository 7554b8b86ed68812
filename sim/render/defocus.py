"""Blur of what does not lie in the plane that the lens is focused on.

A thin lens of focal length f at f-number N images a point at depth z, focused at z_f, as a disk
of diameter c = (f / N) v |1/z - 1/z_f| with v the image distance (Kingslake, A History of the
Photographic Lens, appendix; any text on depth of field). In pixels v is the scale factor alpha,
whatever the pitch. Diffraction and aberrations add a Gaussian that does not depend on depth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from calib.views import FloatArray
from sim.render.surface import NODE_STEP_PX, Image

_TILE_PX = 256
_LEVEL_GROWTH = 1.15
_FINE = 16


@dataclass(frozen=True)
class Blur:
    """How the lens stands during a frame.

    Attributes
    ----------
    aperture_m:
        Diameter of the entrance pupil: focal length over f-number, metres.
    focus_distance_m:
        Depth of the sharp plane; infinity is allowed.
    lens_sigma_px:
        Blur of the lens itself at best focus, Gaussian sigma.
    """

    aperture_m: float
    focus_distance_m: float
    lens_sigma_px: float = 0.0

    def radius_px(self, depth_m: FloatArray, alpha_px: float) -> FloatArray:
        """Radius of the blur disk at each depth, pixels."""
        vergence = np.abs(1.0 / depth_m - 1.0 / self.focus_distance_m)
        return np.asarray(0.5 * self.aperture_m * alpha_px * vergence)


def defocus(image: Image, radius_nodes_px: FloatArray, lens_sigma_px: float) -> Image:
    """Blur a sharp image by disks whose radius varies slowly over it.

    Parameters
    ----------
    image:
        (H, W) float32 sharp image.
    radius_nodes_px:
        (R, C) disk radius at the surface's nodes; NaN where nothing is seen.
    lens_sigma_px:
        Gaussian sigma added everywhere.

    Returns
    -------
    (H, W) float32. Between two neighbouring radii the image is blended, so that no seam shows.
    """
    if lens_sigma_px == 0.0 and not np.nanmax(radius_nodes_px, initial=0.0) > 0.0:
        return image
    levels = np.nan_to_num(_level_of(radius_nodes_px)).astype(np.float32)
    halo = _kernel(int(np.ceil(levels.max())), lens_sigma_px).shape[0] // 2
    padded = cv2.copyMakeBorder(image, halo, halo, halo, halo, cv2.BORDER_REPLICATE)
    out = image.copy()
    for y, x in _tiles(image.shape):
        target = out[y : y + _TILE_PX, x : x + _TILE_PX]
        h, w = target.shape
        source = np.asarray(padded[y : y + h + 2 * halo, x : x + w + 2 * halo], np.float32)
        if np.ptp(source) > 0:
            target[:] = _blurred(source, _levels_in(levels, y, x, (h, w)), halo, lens_sigma_px)
    return out


def _tiles(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    for y in range(0, shape[0], _TILE_PX):
        for x in range(0, shape[1], _TILE_PX):
            yield y, x


def _blurred(source: Image, level: Image, halo: int, lens_sigma_px: float) -> Image:
    total = np.zeros(level.shape, np.float32)
    for k in range(int(np.floor(level.min())), int(np.ceil(level.max())) + 1):
        share = np.maximum(0.0, 1.0 - np.abs(level - k))
        if share.any():
            filtered = cv2.filter2D(source, cv2.CV_32F, _kernel(k, lens_sigma_px))
            total += share * filtered[halo : halo + level.shape[0], halo : halo + level.shape[1]]
    return total


def _levels_in(levels: Image, y: int, x: int, shape: tuple[int, int]) -> Image:
    """Level of each pixel of a tile, linear between the nodes."""
    scale = 1.0 / NODE_STEP_PX
    place = np.array([[scale, 0.0, x * scale + 1.0], [0.0, scale, y * scale + 1.0]])
    return np.asarray(
        cv2.warpAffine(
            levels,
            place,
            shape[::-1],
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )


def _level_of(radius_px: FloatArray) -> FloatArray:
    """Levels lie close for small disks and 15 % apart for large ones."""
    return np.asarray(np.log1p(2.0 * radius_px) / np.log(_LEVEL_GROWTH))


@lru_cache(maxsize=256)
def _kernel(level: int, lens_sigma_px: float) -> Image:
    """Disk of one level with the lens's own blur, integrated over each pixel's square."""
    radius = max(0.5 * (_LEVEL_GROWTH**level - 1.0), 1.0 / _FINE)
    half = int(np.ceil(radius - 0.5 + 4.0 * lens_sigma_px))
    size = (2 * half + 1) * _FINE
    place = (np.arange(size) + 0.5) / _FINE - half - 0.5
    distance = np.hypot(place[:, None], place[None])
    disk = np.clip((radius - distance) * _FINE + 0.5, 0.0, 1.0)
    if lens_sigma_px > 0:
        sigma = lens_sigma_px * _FINE
        disk[:] = cv2.GaussianBlur(disk, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    pixels = disk.reshape(2 * half + 1, _FINE, 2 * half + 1, _FINE).sum(axis=(1, 3))
    return np.asarray(pixels / pixels.sum(), np.float32)
