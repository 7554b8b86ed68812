"""A frame as a JPEG that a tablet can show."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH_PX = 1280
_QUALITY = 80


def jpeg(image: NDArray[np.generic]) -> bytes:
    """A picture, no wider than `WIDTH_PX`.

    One of more than 8 bits is shown by the bits it uses, so that what is saturated looks it.
    """
    shown = np.asarray(image)
    if shown.dtype != np.uint8:
        bits = max(8, int(shown.max()).bit_length())
        shown = (shown >> (bits - 8)).astype(np.uint8)
    height, width = shown.shape[:2]
    if width > WIDTH_PX:
        size = (WIDTH_PX, max(1, round(height * WIDTH_PX / width)))
        shown = cv2.resize(shown, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
