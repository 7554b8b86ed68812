"""Loopback addresses: devices listen on their makers' ports, so each simulated one has its own."""

from __future__ import annotations

import itertools
import os

_PER_PROCESS = 1 << 10
_PROCESSES = 1 << 13
_count = itertools.count()


def own_address() -> str:
    """A loopback address that no other simulated device on this machine has.

    Returns
    -------
    str
        One of 127.64.0.0 to 127.191.255.255, a different one at each of a process's first 1024
        calls; processes have different ones as long as their numbers are not a multiple of 8192
        apart. 127.0.x.x is left to others.
    """
    number = os.getpid() % _PROCESSES * _PER_PROCESS + next(_count) % _PER_PROCESS
    return f"127.{64 + (number >> 16)}.{number >> 8 & 255}.{number & 255}"
