"""The sizes at which a picture is searched."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

FloatImage = NDArray[np.float32]

_FIRST_LEVEL_PIXELS = 0.4e6
_SMALLEST_SIDE_PX = 100


def scales(shape: tuple[int, ...]) -> list[float]:
    """Image scales in the order in which they are tried."""
    first = 0
    while shape[0] * shape[1] * 0.25**first > _FIRST_LEVEL_PIXELS:
        first += 1
    coarser = [s for s in (first + 1, first + 2) if min(shape[:2]) * 0.5**s >= _SMALLEST_SIDE_PX]
    return [0.5**s for s in (first, *range(first - 1, -1, -1), *coarser)]


def scaled(image: FloatImage, scale: float) -> FloatImage:
    """The picture made smaller by a whole number, each pixel the mean of those it covers."""
    if scale == 1.0:
        return image
    factor = round(1 / scale)
    height, width = (side // factor for side in image.shape)
    whole = image[: height * factor, : width * factor]
    return np.asarray(
        cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), dtype=np.float32
    )
