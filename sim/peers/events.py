"""What reached a simulated controller, and when."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Event:
    """Something that reached the controller, on the host's monotonic clock."""

    t_s: float
    what: str
