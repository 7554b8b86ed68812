"""A stop is what a reading confirms: orders, readings, a deadline, and the word of it.

An order that was sent, and even one that was answered, is no stop: a controller may take it and
drive on. So the arm is read until fresh readings prove that it stands, and the order is repeated
until they do. A driver sends it on every path that it has, and goes further each time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cell.sequencer.clock import Clock
from cell.sequencer.rest import RestEvidence
from drivers.arm import Arm, ArmState

DEADLINE_S = 3.0
"""Without the proof by then, the word is that nobody knows."""
_REPEAT_S = 0.1
_POLL_S = 0.008


@dataclass(frozen=True)
class StopReport:
    """What is known after a stop.

    Attributes
    ----------
    stands:
        Whether fresh readings prove that the arm stands. Nothing else makes a stop done.
    after_s:
        Time from the order to this word.
    orders:
        How often the order was given.
    text:
        For the operator: since when it stands, or what is not known and what to press.
    """

    stands: bool
    after_s: float
    orders: int
    text: str


class ConfirmedStop:
    """Stops one arm; every verb that moves an arm does so through this.

    Parameters
    ----------
    arm, clock:
        The arm, connected, and the clock its `host_t_s` counts on.
    on_reading:
        Called with every reading; must not raise or block.
    """

    def __init__(
        self, arm: Arm, clock: Clock, on_reading: Callable[[ArmState], None] = lambda state: None
    ) -> None:
        self._arm, self._clock, self._on_reading = arm, clock, on_reading

    def see_through(
        self, before: ArmState | None = None, *, least_way_rad: float = -1.0
    ) -> StopReport:
        """Order the stop, again and again, until readings prove it or `DEADLINE_S` has passed.

        Parameters
        ----------
        before, least_way_rad:
            The newest reading from before, and how far the arm has gone since, at least: see
            `RestEvidence`.
        """
        began_s = due_s = self._clock.now()
        evidence = RestEvidence(began_s, before, least_way_rad)
        orders, refusal = 0, ""
        while True:
            now_s = self._clock.now()
            if now_s >= due_s and not evidence.standing:
                refusal = self._order()
                orders, due_s = orders + 1, now_s + _REPEAT_S
            stands = self._read(evidence)
            after_s = self._clock.now() - began_s
            if stands:
                text = f"the arm stands: readings confirm it {after_s:.2f} s after the order"
                return StopReport(True, after_s, orders, text)
            if after_s > DEADLINE_S:
                return StopReport(False, after_s, orders, _alarm(evidence, refusal, orders))
            self._clock.sleep(_POLL_S)

    def _order(self) -> str:
        """Give the order; returns why it was not taken, empty where it was."""
        try:
            self._arm.stop()
        except Exception as refusal:
            return str(refusal) or type(refusal).__name__
        return ""

    def _read(self, evidence: RestEvidence) -> bool:
        try:
            state = self._arm.state()
        except Exception as lost:
            evidence.lost(str(lost) or type(lost).__name__)
            return False
        self._on_reading(state)
        return evidence.shows_rest(state)


def _alarm(evidence: RestEvidence, refusal: str, orders: int) -> str:
    known = "THE ARM DOES NOT STOP" if evidence.fresh else "NOBODY KNOWS WHETHER THE ARM STANDS"
    refused = f"; the order was not taken: {refusal}" if refusal else ""
    return (
        f"{known}: {DEADLINE_S:g} s and {orders} orders after the first, {evidence.missing}"
        f"{refused}. PRESS THE EMERGENCY STOP NOW."
    )
