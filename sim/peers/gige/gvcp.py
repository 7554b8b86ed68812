"""GigE Vision's control protocol (GVCP): packets in, packets out, no state.

Source: AIA GigE Vision Specification 2.0, chapters 14 to 18 (commands and status codes).
Every field is big-endian; an address is a byte address in the device's register map.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

PORT = 3956
_KEY = 0x42
_ACK_REQUIRED = 0x01
_HEADER = struct.Struct(">BBHHH")


class Command(IntEnum):
    """Command words; the acknowledge of a command is its word plus one."""

    DISCOVERY = 0x0002
    PACKET_RESEND = 0x0040
    READ_REGISTER = 0x0080
    WRITE_REGISTER = 0x0082
    READ_MEMORY = 0x0084
    WRITE_MEMORY = 0x0086


class Status(IntEnum):
    """Status word of an acknowledge."""

    SUCCESS = 0x0000
    NOT_IMPLEMENTED = 0x8001
    INVALID_PARAMETER = 0x8002
    INVALID_ADDRESS = 0x8003
    WRITE_PROTECT = 0x8004
    BAD_ALIGNMENT = 0x8005
    ACCESS_DENIED = 0x8006


class Refused(Exception):
    """The device answers a command with a status other than success."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.name)
        self.status = status


@dataclass(frozen=True)
class Request:
    """One command as it came over the wire."""

    command: int
    request_id: int
    wants_answer: bool
    payload: bytes


def parse(packet: bytes) -> Request | None:
    """The request in a datagram, or None for one that is no GVCP command."""
    if len(packet) < _HEADER.size:
        return None
    key, flags, command, length, request_id = _HEADER.unpack_from(packet)
    payload = packet[_HEADER.size : _HEADER.size + length]
    if key != _KEY or len(payload) != length:
        return None
    return Request(command, request_id, bool(flags & _ACK_REQUIRED), payload)


def acknowledge(request: Request, payload: bytes = b"", status: Status = Status.SUCCESS) -> bytes:
    """The datagram that answers `request`."""
    head = struct.pack(">HHHH", status, request.command + 1, len(payload), request.request_id)
    return head + payload


def resend_range(payload: bytes) -> tuple[int, int, int]:
    """Block id, first and last packet id of a resend request."""
    _, block, first, last = struct.unpack_from(">HHII", payload)
    return block, first & 0xFFFFFF, last & 0xFFFFFF
