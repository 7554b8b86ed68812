"""Time for the simulated devices: their own, which runs as fast as it is waited for, or real."""

from __future__ import annotations

import threading
import time
from typing import Protocol


class Clock(Protocol):
    """What simulated devices live by."""

    def now(self) -> float:
        """Seconds, never backwards."""

    def sleep(self, seconds: float) -> None:
        """Let that much of this clock's time pass."""


class SimClock:
    """Time that passes only while somebody sleeps: a run of an hour takes seconds, and repeats."""

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s
        self._lock = threading.Lock()

    def now(self) -> float:
        """Simulated seconds."""
        with self._lock:
            return self._now_s

    def sleep(self, seconds: float) -> None:
        """Move the time on and return at once."""
        with self._lock:
            self._now_s += max(0.0, seconds)


class WallClock:
    """Real time, `time.monotonic`."""

    def now(self) -> float:
        """Seconds since some fixed instant."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(max(0.0, seconds))
