"""Host time: the real one, or one that a simulated cell moves on."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """What the loop waits by; the devices' `host_t_s` count on the same clock."""

    def now(self) -> float:
        """Seconds, never backwards."""

    def sleep(self, seconds: float) -> None:
        """Let that much of this clock's time pass."""


class HostClock:
    """`time.monotonic`."""

    def now(self) -> float:
        """Seconds since some fixed instant."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)
