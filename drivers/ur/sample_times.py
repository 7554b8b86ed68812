"""When a packet was sampled, on the host's clock: a packet that waited is older than its arrival.

A busy computer, or network, hands packets over in bursts. Taken for what they say at their arrival,
they describe an arm at rest that has long begun to move, or of one that moves and has long stopped.
"""

from __future__ import annotations

_LATELY_S = 5.0
"""The clocks drift: what was the fastest way from there to here is found anew so often."""


class SampleTimes:
    """Turns the controller's times into the host's, by the fastest packet that came lately."""

    def __init__(self) -> None:
        self._lately_s = self._now_s = float("inf")
        self._since_s = -float("inf")

    def host_t_s(self, arrived_s: float, controller_s: float) -> float:
        """Host time at which a packet was sampled that arrived then; never after its arrival."""
        if arrived_s - self._since_s > _LATELY_S:
            self._lately_s, self._now_s, self._since_s = self._now_s, float("inf"), arrived_s
        self._now_s = min(self._now_s, arrived_s - controller_s)
        return controller_s + min(self._lately_s, self._now_s)
