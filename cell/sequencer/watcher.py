"""Who watches a run: terminal, live page, running estimate. None can hold it up or end it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from cell.sequencer.checks import Verdict
from cell.sequencer.shot import Shot
from cell.sequencer.states import Status
from cell.storage.recording import FrameRecord
from drivers.arm import ArmState


@dataclass(frozen=True)
class Checked:
    """A frame that was looked at.

    Attributes
    ----------
    shot:
        The picture and the arm's readings around it.
    verdict:
        What the check found.
    record:
        Its line in the recording; None for a frame that is not kept.
    """

    shot: Shot
    verdict: Verdict
    record: FrameRecord | None


class Watcher:
    """Sees a run go by. No method may block; one that raises ends its watcher's notices.

    Override what is wanted.
    """

    def status_changed(self, status: Status) -> None:
        """The state has changed or something has happened; from the loop's thread."""

    def read(self, state: ArmState) -> None:
        """The arm was read; from the loop's thread, every few milliseconds."""

    def checked(self, checked: Checked) -> None:
        """A frame was checked and, where it is good, is on the disk; from the worker's thread."""


class Watchers:
    """Several watchers as one that never raises.

    Attributes
    ----------
    failures:
        Why watchers were given up and not yet journalled.
    """

    def __init__(self, watchers: Iterable[Watcher]) -> None:
        self._watching = tuple(watchers)
        self.failures: list[str] = []

    def status_changed(self, status: Status) -> None:
        """See `Watcher.status_changed`."""
        self._each(lambda watcher: watcher.status_changed(status))

    def read(self, state: ArmState) -> None:
        """See `Watcher.read`."""
        self._each(lambda watcher: watcher.read(state))

    def checked(self, checked: Checked) -> None:
        """See `Watcher.checked`."""
        self._each(lambda watcher: watcher.checked(checked))

    def _each(self, call: Callable[[Watcher], None]) -> None:
        for watcher in self._watching:
            try:
                call(watcher)
            except Exception as fault:
                self._watching = tuple(w for w in self._watching if w is not watcher)
                self.failures.append(str(fault) or type(fault).__name__)
