"""What comes from outside: made fit for a message, and waited for no longer than was meant."""

from __future__ import annotations

import json
import re
import socket
import time
from typing import Any

_LONGEST_TEXT = 160
_DEEPEST = 64
_BRACKETS = re.compile(rb'"(?:[^"\\]|\\.)*(?:"|\\?\Z)|[\[\]{}]', re.DOTALL)


def check_depth(data: bytes) -> None:
    """Raise `ValueError` for JSON nested deeper than any device nests.

    A parser takes the stack to its end for it, where whatever else happens to run fails, too.
    """
    depth = 0
    for found in _BRACKETS.finditer(data):
        if found[0] in b"[{":
            depth += 1
        elif found[0] in b"]}":
            depth -= 1
        if depth > _DEEPEST:
            raise ValueError(f"nested more than {_DEEPEST} deep")


def parse_json(data: bytes) -> Any:
    """What a device sent as JSON; raises `ValueError` where it is none, or nested too deep."""
    check_depth(data)
    return json.loads(data)


def printable(text: str) -> str:
    """Return a device's own words for a message: one short line without control characters."""
    line = "".join(letter if letter.isprintable() else " " for letter in text[: 4 * _LONGEST_TEXT])
    line = " ".join(line.split())
    return line if len(line) <= _LONGEST_TEXT else f"{line[:_LONGEST_TEXT]} ..."


def receive_within(link: socket.socket, count: int, deadline_s: float | None) -> bytes:
    """Read some bytes, at most `count`, before a deadline on the monotonic clock.

    A time-out of the socket alone starts anew with every byte: a device that sends one now and
    then would hold its reader for ever. None leaves the socket's own time-out in force.

    Raises
    ------
    TimeoutError
        The deadline has passed.
    ConnectionError
        The other side closed the connection.
    """
    if deadline_s is not None:
        left_s = deadline_s - time.monotonic()
        if left_s <= 0:
            raise TimeoutError("timed out")
        link.settimeout(left_s)
    chunk = link.recv(count)
    if not chunk:
        raise ConnectionError("the other side closed the connection")
    return chunk


def exactly(link: socket.socket, count: int, deadline_s: float | None = None) -> bytes:
    """Read `count` bytes; raises as `receive_within` does."""
    data = bytearray()
    while len(data) < count:
        data += receive_within(link, count - len(data), deadline_s)
    return bytes(data)
