"""From light to numbers: lamp, exposure, photon and read noise, gain, quantisation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.render.surface import Image


@dataclass(frozen=True)
class Sensor:
    """A sensor and how well it is lit.

    Attributes
    ----------
    full_well_e:
        Electrons at which a pixel reads 255 at 0 dB; None for light without photon noise.
    read_noise_levels:
        Standard deviation of the readout in levels of the 8-bit image at 0 dB.
    white_exposure_s:
        Exposure at which a perfectly white board reads 255 in the image's centre at 0 dB.
    falloff, gradient_x, gradient_y:
        Relative loss of light in the image's corner, and change from edge to edge.
    """

    full_well_e: float | None = 10_000.0
    read_noise_levels: float = 0.5
    white_exposure_s: float = 0.012
    falloff: float = 0.12
    gradient_x: float = 0.06
    gradient_y: float = -0.04


def expose(
    reflectance: Image,
    sensor: Sensor,
    *,
    exposure_s: float,
    gain_db: float = 0.0,
    rng: np.random.Generator | None = None,
) -> NDArray[np.uint8]:
    """(H, W) 8-bit image of an evenly sampled reflectance.

    Photon noise has the variance of the electrons counted (Poisson's, taken as normal: dark
    toner alone still gives hundreds of electrons), read noise adds; no noise where `rng` is None.
    """
    levels = reflectance * _lamp(reflectance.shape, sensor)
    levels *= np.float32(255.0 * exposure_s / sensor.white_exposure_s)
    if rng is not None:
        levels += _spread(levels, sensor) * rng.standard_normal(levels.shape, np.float32)
    levels *= np.float32(10.0 ** (gain_db / 20.0))
    return np.asarray(np.clip(np.rint(levels), 0, 255), np.uint8)


def _spread(levels: Image, sensor: Sensor) -> Image:
    """Standard deviation of each pixel, levels."""
    read = np.float32(sensor.read_noise_levels**2)
    if sensor.full_well_e is None:
        return np.full_like(levels, np.sqrt(read))
    return np.asarray(np.sqrt(levels * np.float32(255.0 / sensor.full_well_e) + read))


def _lamp(shape: tuple[int, ...], sensor: Sensor) -> Image:
    """Relative illumination of each pixel: a slope across, and a falloff with radius squared."""
    y, x = (np.linspace(-0.5, 0.5, n, dtype=np.float32) for n in shape)
    along_x = 1.0 + sensor.gradient_x * x - 2.0 * sensor.falloff * x * x
    along_y = sensor.gradient_y * y - 2.0 * sensor.falloff * y * y
    return np.asarray(np.add.outer(along_y, along_x), dtype=np.float32)
