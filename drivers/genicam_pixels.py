"""A buffer's bytes as an image, by the name of its pixel format.

Source: EMVA/AIA Pixel Format Naming Convention (PFNC) 2.1; unpacked formats only.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.errors import DeviceRefused

_MONO = {"Mono8": "u1", "Mono10": "<u2", "Mono12": "<u2", "Mono14": "<u2", "Mono16": "<u2"}
# OpenCV names a Bayer pattern after the second row's second and third pixel, PFNC after the first
_TO_BGR = {
    "RGB8": (3, cv2.COLOR_RGB2BGR),
    "BGR8": (3, None),
    "RGBa8": (4, cv2.COLOR_RGBA2BGR),
    "BGRa8": (4, cv2.COLOR_BGRA2BGR),
    "BayerRG8": (1, cv2.COLOR_BayerBG2BGR),
    "BayerGR8": (1, cv2.COLOR_BayerGB2BGR),
    "BayerGB8": (1, cv2.COLOR_BayerGR2BGR),
    "BayerBG8": (1, cv2.COLOR_BayerRG2BGR),
}
PIXEL_FORMATS = tuple(_MONO) + tuple(_TO_BGR)


def require_known(pixel_format: str) -> None:
    """Raise `DeviceRefused` for a pixel format that `decode` does not know."""
    if pixel_format not in PIXEL_FORMATS:
        known = ", ".join(PIXEL_FORMATS)
        raise DeviceRefused(f"pixel format {pixel_format} is not supported; choose one of {known}")


def decode(data: bytes, width: int, height: int, pixel_format: str) -> NDArray[np.generic]:
    """The image in a buffer: (height, width), or (height, width, 3) in BGR order for colour.

    Samples keep their values: Mono12 gives 0 to 4095 in uint16.

    Raises
    ------
    ValueError
        The buffer is not as long as an image of that size.
    """
    if pixel_format in _MONO:
        return np.frombuffer(data, _MONO[pixel_format]).reshape(height, width)
    channels, conversion = _TO_BGR[pixel_format]
    shape = (height, width) if channels == 1 else (height, width, channels)
    image = np.frombuffer(data, np.uint8).reshape(shape)
    return image if conversion is None else np.asarray(cv2.cvtColor(image, conversion))
