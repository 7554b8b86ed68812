"""How soon the controller is asked again: seldom on the way, often when an answer is due.

An IRC5 bears fewer than twenty requests a second; a move's end that is noticed late costs time in
every pose. So the end is guessed from the way that is left, and only then asked for often.
"""

from __future__ import annotations

import time

from drivers.abb.program import way_left
from drivers.abb.readings import Reading
from drivers.arm import MoveTarget

_DUE_S, _RESTING_S, _AT_REST_S = 0.045, 0.03, 0.06
_BEFORE_S, _AFTER_S = 0.15, 0.8


class Pace:
    """Pauses between polls.

    Parameters
    ----------
    poll_s:
        Pause while the arm is on its way and far from its target.
    """

    def __init__(self, poll_s: float) -> None:
        self._poll_s = poll_s
        self._target: MoveTarget | None = None
        self._seen = (0.0, 0.0)
        self._due_s: float | None = None

    def begin(self, target: MoveTarget, reading: Reading) -> None:
        """A move begins where `reading` says."""
        self._target, self._due_s = target, None
        self._seen = time.monotonic(), way_left(target, reading)

    def on_the_way(self, reading: Reading) -> None:
        """Guess the end anew; the arm brakes before it, so that it comes a little later."""
        if self._target is None:
            return
        before_s, before = self._seen
        left = way_left(self._target, reading)
        speed = (before - left) / max(reading.host_t_s - before_s, 1e-6)
        if speed > 0.0:
            self._due_s = reading.host_t_s + left / speed
        self._seen = reading.host_t_s, left

    def pause_s(self, *, running: bool, still: bool) -> float:
        """Seconds until the next poll."""
        if still:
            return _AT_REST_S
        if not running:
            return _RESTING_S
        if self._due_s is None:
            return self._poll_s
        due_in_s = self._due_s - time.monotonic()
        if due_in_s > _BEFORE_S:
            return min(self._poll_s, due_in_s - 0.5 * _BEFORE_S)
        return _DUE_S if due_in_s > -_AFTER_S else self._poll_s
