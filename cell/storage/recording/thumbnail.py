"""Small pictures, made while the large one is at hand: decoding is what costs."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH_PX = 220
KEPT = 300
"""So many are kept, more than a report shows: a long recording must not fill the memory."""


def shrunk(picture: NDArray[Any]) -> NDArray[np.generic]:
    """The picture no wider than `WIDTH_PX`, in its own depth and colours."""
    height, width = picture.shape[:2]
    if width <= WIDTH_PX:
        return picture
    size = WIDTH_PX, max(1, round(WIDTH_PX * height / width))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
