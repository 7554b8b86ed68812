"""What may end a run before it has taken all views of its plan."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Protocol


class Goal(Protocol):
    """Asked by the loop before every move; never blocks."""

    def caught_up(self) -> Future[None]:
        """Done once the frames of a run that is gone on with are taken into account."""

    def reached(self) -> str:
        """Why no further view is needed, as text for the operator; empty while one is."""
