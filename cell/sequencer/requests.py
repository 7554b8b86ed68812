"""What the operator may ask of a run besides a stop: to pause, to go on, to give a view up."""

from __future__ import annotations

import threading

SKIPPED_BY_OPERATOR = "given up by the operator"


class Requests:
    """Flags that anyone may set, from any thread; the loop heeds them where the arm stands."""

    def __init__(self) -> None:
        self._go_on = threading.Event()
        self._go_on.set()
        self._skip: int | None = None

    @property
    def paused(self) -> bool:
        """Whether the run is to wait at the end of the move it makes."""
        return not self._go_on.is_set()

    def pause(self) -> None:
        """Ask to wait at the end of the present move."""
        self._go_on.clear()

    def go_on(self) -> None:
        """Ask to go on."""
        self._go_on.set()

    def wait(self, seconds: float) -> None:
        """Let real time pass, no longer than until somebody asks to go on."""
        self._go_on.wait(seconds)

    def skip(self, view: int) -> None:
        """Ask to give a view of the plan up; nothing happens where it is taken already."""
        self._skip = view

    def skips(self, view: int) -> bool:
        """Whether that view is to be given up."""
        return self._skip == view
