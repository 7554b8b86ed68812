"""How large a JPEG picture is, read from its header, before anything is allocated for it.

Source: ITU-T T.81, annex B: a file is a row of markers, FF and a code, each of which but a few is
followed by the length of its segment; the frame header (SOF) holds height and width.
"""

from __future__ import annotations

import struct

_START, _WITHOUT_LENGTH = 0xD8, {0x01, *range(0xD0, 0xD8)}
_FRAME_HEADERS = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SCAN, _END = 0xDA, 0xD9


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) in pixels; None where the file has no frame header."""
    if data[:2] != bytes([0xFF, _START]):
        return None
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        code = data[at + 1]
        if code in (_SCAN, _END):
            return None
        if code in _FRAME_HEADERS:
            return _size_in(data, at + 4)
        at += _step(data, at, code)
    return None


def _step(data: bytes, at: int, code: int) -> int:
    """Bytes to the next marker."""
    if code == 0xFF:  # a marker may be preceded by any number of these
        return 1
    if code in _WITHOUT_LENGTH:
        return 2
    length: int = struct.unpack_from(">H", data, at + 2)[0]
    return 2 + max(length, 2)


def _size_in(data: bytes, at: int) -> tuple[int, int] | None:
    if at + 5 > len(data):
        return None
    height, width = struct.unpack_from(">HH", data, at + 1)
    return width, height
