"""RTDE frames: how the controller's port 30004 packs its data.

Source: Universal Robots, "Real-Time Data Exchange (RTDE) Guide". A frame is a big-endian
uint16 size (its own three header bytes included), a uint8 type and the payload.
"""

from __future__ import annotations

import socket
import struct
from enum import IntEnum

from drivers.outside import exactly

RTDE_PORT = 30004
PROTOCOL_VERSION = 2
_HEADER = struct.Struct(">HB")

_STRUCT_CODES = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}

Value = float | int | bool | tuple[float, ...]


class Frame(IntEnum):
    """The type byte of a frame."""

    REQUEST_PROTOCOL_VERSION = 86
    GET_CONTROLLER_VERSION = 118
    TEXT_MESSAGE = 77
    DATA_PACKAGE = 85
    SETUP_OUTPUTS = 79
    SETUP_INPUTS = 73
    START = 83
    PAUSE = 80


class Recipe:
    """The fields of one data package, in order.

    Parameters
    ----------
    names:
        Variable names as the controller knows them.
    types:
        Their RTDE types, such as ``VECTOR6D``, one for each name; raises `ValueError` where one
        is missing or unknown.
    """

    def __init__(self, names: list[str], types: list[str]) -> None:
        if len(names) != len(types):
            raise ValueError(f"{len(types)} types for {len(names)} names")
        for name, kind in zip(names, types, strict=True):
            if kind not in _STRUCT_CODES:
                raise ValueError(f"an unknown type for {name}")
        self.names = names
        self._widths = [_width(kind) for kind in types]
        self._struct = struct.Struct(">" + "".join(_STRUCT_CODES[kind] for kind in types))

    @property
    def size(self) -> int:
        """Bytes of a package's fields."""
        return self._struct.size

    def unpack(self, body: bytes) -> dict[str, Value]:
        """Return name -> value; vectors are tuples. Raises `struct.error` on a wrong length."""
        flat = iter(self._struct.unpack(body))
        return {
            name: next(flat) if width == 1 else tuple(next(flat) for _ in range(width))
            for name, width in zip(self.names, self._widths, strict=True)
        }

    def pack(self, values: dict[str, Value]) -> bytes:
        """Return the bytes of the values, in the recipe's order."""
        flat: list[float | int | bool] = []
        for name in self.names:
            value = values[name]
            flat.extend(value if isinstance(value, tuple) else (value,))
        return self._struct.pack(*flat)


def _width(kind: str) -> int:
    code = _STRUCT_CODES[kind]
    return int(code[0]) if len(code) > 1 else 1


def encode(kind: int, payload: bytes = b"") -> bytes:
    """Return a whole frame."""
    return _HEADER.pack(len(payload) + _HEADER.size, kind) + payload


def receive(link: socket.socket, deadline_s: float | None = None) -> tuple[int, bytes]:
    """Read one frame: (type, payload).

    Parameters
    ----------
    link:
        An open connection.
    deadline_s:
        For the whole frame, on the monotonic clock; None for the socket's own time-out.

    Raises
    ------
    ConnectionError
        The other side closed, or the size in the header is impossible.
    TimeoutError
        The frame did not come in time.
    """
    size, kind = _HEADER.unpack(exactly(link, _HEADER.size, deadline_s))
    if size < _HEADER.size:
        raise ConnectionError(f"an RTDE frame claims a size of {size} bytes")
    return kind, exactly(link, size - _HEADER.size, deadline_s)
