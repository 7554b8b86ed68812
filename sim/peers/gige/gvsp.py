"""GigE Vision's stream protocol (GVSP): an image cut into leader, payload packets and trailer.

Source: AIA GigE Vision Specification 2.0, chapters 23 to 25, standard (16-bit block) ids.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_IP_UDP_GVSP_HEADERS = 20 + 8 + 8
_IMAGE_PAYLOAD = 0x0001
_LEADER, _TRAILER, _PAYLOAD = 1, 2, 3

MONO8, MONO16 = 0x01080001, 0x01100007
BITS = {MONO8: 8, MONO16: 16}


def _header(kind: int, block_id: int, packet_id: int) -> bytes:
    return struct.pack(">HHI", 0, block_id, kind << 24 | packet_id)


@dataclass(frozen=True)
class Block:
    """One image on the wire; `packet(i)` is its i-th datagram, leader first, trailer last.

    Attributes
    ----------
    pixels:
        The payload, little-endian samples, row by row.
    packet_bytes:
        Size of a packet as the register states it: with IP, UDP and GVSP headers.
    timestamp_ns:
        The device's clock at the start of the exposure.
    """

    block_id: int
    pixels: memoryview
    width: int
    height: int
    pixel_format: int
    timestamp_ns: int
    packet_bytes: int

    @property
    def _data_bytes(self) -> int:
        return self.packet_bytes - _IP_UDP_GVSP_HEADERS

    @property
    def packets(self) -> int:
        """How many datagrams the block takes."""
        return 2 + -(-len(self.pixels) // self._data_bytes)

    def packet(self, packet_id: int) -> bytes:
        """The datagram with that id."""
        if packet_id == 0:
            return self._leader()
        if packet_id == self.packets - 1:
            trailer = struct.pack(">HHI", 0, _IMAGE_PAYLOAD, self.height)
            return _header(_TRAILER, self.block_id, packet_id) + trailer
        start = (packet_id - 1) * self._data_bytes
        data = self.pixels[start : start + self._data_bytes]
        return _header(_PAYLOAD, self.block_id, packet_id) + data

    def _leader(self) -> bytes:
        image = struct.pack(
            ">HHQIIIIIHH",
            0,
            _IMAGE_PAYLOAD,
            self.timestamp_ns,
            self.pixel_format,
            self.width,
            self.height,
            0,
            0,
            0,
            0,
        )
        return _header(_LEADER, self.block_id, 0) + image


def pixels_as(image: NDArray[np.generic], pixel_format: int) -> memoryview:
    """The image's samples in `pixel_format`; 8 bits become 16 by scaling, colour becomes grey."""
    grey = image if image.ndim == 2 else image.mean(axis=2).astype(image.dtype)
    if pixel_format == MONO8:
        grey = grey if grey.dtype == np.uint8 else (grey.astype(np.uint16) >> 8)
        return memoryview(np.ascontiguousarray(grey, np.uint8).tobytes())
    grey = grey.astype("<u2") * (257 if grey.dtype == np.uint8 else 1)
    return memoryview(np.ascontiguousarray(grey, "<u2").tobytes())


def probe_packet(packet_bytes: int) -> bytes:
    """The datagram that a host orders to learn whether this size passes the network."""
    return bytes(packet_bytes - 28)
