"""Being asked to stop: signals and buttons set a flag, the loop does the stopping."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


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
    """SIGINT, SIGTERM and SIGHUP set `stop` and do nothing else while this holds."""

    def handle(number: int, frame: FrameType | None) -> None:
        stop.ask("Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)

    before = {number: signal.signal(number, handle) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
