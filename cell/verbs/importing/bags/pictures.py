"""Pixels of a message, at the depth they came in."""

from __future__ import annotations

import re
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cell.errors import InputError
from cell.storage.incoming import decode_picture
from cell.storage.incoming.pictures import check_pixels

_CHANNELS = {
    "mono8": (np.uint8, 1), "mono16": (np.uint16, 1), "8UC1": (np.uint8, 1),
    "16UC1": (np.uint16, 1), "8UC3": (np.uint8, 3), "16UC3": (np.uint16, 3),
    "bgr8": (np.uint8, 3), "bgr16": (np.uint16, 3), "bgra8": (np.uint8, 4),
    "bgra16": (np.uint16, 4), "rgb8": (np.uint8, 3), "rgb16": (np.uint16, 3),
    "rgba8": (np.uint8, 4), "rgba16": (np.uint16, 4),
    "yuv422": (np.uint8, 2), "uyvy": (np.uint8, 2),
    "yuv422_yuy2": (np.uint8, 2), "yuyv": (np.uint8, 2),
}  # fmt: skip
_TO_BGR = {
    "rgb8": cv2.COLOR_RGB2BGR, "rgb16": cv2.COLOR_RGB2BGR,
    "rgba8": cv2.COLOR_RGBA2BGR, "rgba16": cv2.COLOR_RGBA2BGR,
    "bgra8": cv2.COLOR_BGRA2BGR, "bgra16": cv2.COLOR_BGRA2BGR,
    "yuv422": cv2.COLOR_YUV2BGR_UYVY, "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2BGR_YUY2, "yuyv": cv2.COLOR_YUV2BGR_YUY2,
}  # fmt: skip
_BAYER = re.compile(r"bayer_(rggb|bggr|gbrg|grbg)(8|16)")
# ROS names a Bayer pattern by its first four pixels, OpenCV's old names by those one row and one
# column on: `bayer_rggb8` is OpenCV's BayerBG
_MOSAIC = {
    "rggb": cv2.COLOR_BayerBG2BGR,
    "bggr": cv2.COLOR_BayerRG2BGR,
    "gbrg": cv2.COLOR_BayerGR2BGR,
    "grbg": cv2.COLOR_BayerGB2BGR,
}


def picture(message: Any, where: str) -> NDArray[np.generic]:
    """(h, w) or (h, w, 3) BGR picture of an Image or CompressedImage, 8 or 16 bits as it came.

    Raises
    ------
    InputError
        Its encoding is not known, or its bytes are not what its header says.
    """
    return _raw(message, where) if hasattr(message, "step") else _compressed(message, where)


def _raw(message: Any, where: str) -> NDArray[np.generic]:
    encoding = str(message.encoding)
    bayer = _BAYER.fullmatch(encoding)
    if bayer is None and encoding not in _CHANNELS:
        known = ", ".join((*_CHANNELS, "bayer_rggb8"))
        raise InputError(f"{where}: encoding {encoding[:40]!r} is not known; known are {known} ...")
    deep, channels = _CHANNELS.get(encoding) or _CHANNELS[f"mono{bayer[2] if bayer else 8}"]
    width, height, step = int(message.width), int(message.height), int(message.step)
    try:
        check_pixels(width, height)
    except ValueError as many:
        raise InputError(f"{where}: {many}") from None
    kind = np.dtype(deep).newbyteorder(">" if message.is_bigendian else "<")
    line = width * channels * kind.itemsize
    data = np.frombuffer(message.data, np.uint8)
    # a line may be padded at its end, the last one need not be
    if not line or not height or step < line or data.size < step * (height - 1) + line:
        raise InputError(
            f"{where}: {data.size} bytes are no picture of {width} x {height} {encoding[:40]} with"
            f" lines of {step} bytes"
        )
    lines = np.lib.stride_tricks.as_strided(data, (height, line), (step, 1), writeable=False)
    pixels = np.ascontiguousarray(lines).view(kind).astype(deep)
    shaped = pixels.reshape((height, width, channels) if channels > 1 else (height, width))
    if bayer is not None:
        return _colour(shaped, _MOSAIC[bayer[1]])
    return _colour(shaped, _TO_BGR[encoding]) if encoding in _TO_BGR else shaped


def _colour(image: NDArray[Any], conversion: int) -> NDArray[np.generic]:
    return np.asarray(cv2.cvtColor(image, conversion))


def _compressed(message: Any, where: str) -> NDArray[np.generic]:
    """As encoded, 16 bits where the file has them; a mosaic that was compressed made colour."""
    if "compressedDepth" in str(message.format):
        raise InputError(f"{where}: is a depth picture ({message.format}); name another topic")
    image = decode_picture(bytes(message.data), where)
    encoding, _, after = str(message.format).partition(";")
    bayer = _BAYER.search(encoding)
    if bayer is not None and image.ndim == 2 and "compressed bgr" not in after:
        image = _colour(image, _MOSAIC[bayer[1]])
    return image if image.ndim == 2 else image[..., :3]
