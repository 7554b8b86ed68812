"""Pictures: of a known format, their size known before a pixel is decoded."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cell.errors import InputError
from cell.storage.incoming.limits import PICTURE_BYTES, PICTURE_PIXELS
from cell.storage.incoming.text import read_bytes

FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM", "WEBP")
"""Formats that are read; PPM stands for PGM and PBM too."""
Image.MAX_IMAGE_PIXELS = None  # judged here, by `PICTURE_PIXELS`, before anything is decoded


def read_picture(path: Path) -> NDArray[np.generic]:
    """(height, width[, 3]) picture of a file, as stored; raises `InputError`."""
    return decode_picture(read_bytes(path, PICTURE_BYTES), str(path))


def decode_picture(data: bytes, where: str) -> NDArray[np.generic]:
    """(height, width[, 3]) picture out of a file's bytes.

    Raises
    ------
    InputError
        It is of no known format, has too many pixels, or is broken.
    """
    import cv2  # many a verb reads files and no picture

    size = _size_px(data)
    if size is None:
        raise InputError(f"{where}: is not an image ({', '.join(FORMATS)})")
    width_px, height_px = size
    try:
        check_pixels(width_px, height_px)
    except ValueError as many:
        raise InputError(f"{where}: {many}") from None
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as broken:
        raise InputError(f"{where}: is not an image: {broken.err}") from None
    if image is None or not image.size:
        raise InputError(f"{where}: is not an image that can be decoded")
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{where}: has pixels of type {image.dtype}; 8 and 16 bits are read")
    return image


def picture_size_px(path: Path) -> tuple[int, int] | None:
    """(width, height) as a picture's header says; None where it is of no known format."""
    return _size_px(read_bytes(path, PICTURE_BYTES))


def check_pixels(width_px: int, height_px: int) -> None:
    """Raise `ValueError` where a picture of that size is more than is read."""
    if width_px * height_px > PICTURE_PIXELS:
        raise ValueError(
            f"{width_px} x {height_px} pixels are too many; pictures have at most"
            f" {PICTURE_PIXELS // 10**6} million"
        )


def _size_px(data: bytes) -> tuple[int, int] | None:
    """(width, height) as the file's header says, or None where it is of no known format."""
    try:
        with Image.open(io.BytesIO(data), formats=FORMATS) as image:
            return image.size
    except Exception:  # Pillow documents no bound to what a broken header raises
        return None
