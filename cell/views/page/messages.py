"""The last lines for the operator, each with the time of day."""

from __future__ import annotations

import time

_KEPT = 60


class Messages:
    """A short log; the newest line comes first."""

    def __init__(self) -> None:
        self._lines: tuple[dict[str, str], ...] = ()

    def add(self, text: str) -> None:
        """One more line."""
        line = {"at": time.strftime("%H:%M:%S"), "words": text}
        self._lines = (line, *self._lines[: _KEPT - 1])

    def lines(self) -> tuple[dict[str, str], ...]:
        """The lines, newest first."""
        return self._lines
