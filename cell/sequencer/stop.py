"""Being asked to stop: signals and buttons set a flag, the loop does the stopping."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

FROM_TERMINAL = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGHUP: "SIGHUP",
    signal.SIGQUIT: "Ctrl-\\",
    signal.SIGTSTP: "Ctrl-Z",
}
"""What a terminal sends to every process of a command.

A run that was suspended would leave nobody at the arm, and one that died at once nothing but the
controller's own watch.
"""
_ASKED_BY = FROM_TERMINAL | {signal.SIGTERM: "SIGTERM"}


class StopRequest:
    """A flag that anyone may set, from any thread or signal handler.

    Attributes
    ----------
    count:
        How often a stop was asked for.
    reason:
        Who asked first, as text.
    """

    def __init__(self) -> None:
        self.count = 0
        self.reason = ""

    def ask(self, reason: str) -> None:
        """Ask for a stop."""
        self.reason = self.reason or reason
        self.count += 1

    @property
    def asked(self) -> bool:
        """Whether anybody asked."""
        return self.count > 0


@contextmanager
def signals_ask(stop: StopRequest) -> Iterator[None]:
    """A terminal's signals and SIGTERM set `stop` and do nothing else while this holds."""

    def handle(number: int, frame: FrameType | None) -> None:
        stop.ask(_ASKED_BY[signal.Signals(number)])

    before = {number: signal.signal(number, handle) for number in _ASKED_BY}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
