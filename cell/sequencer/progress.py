"""What is done and what is left of a run, and how long it will take."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from calib.detection import Detection


@dataclass
class Progress:
    """What is done and what is left of a run.

    Attributes
    ----------
    todo:
        Views to take, next first.
    done:
        Views with a logged frame.
    skipped:
        Views given up, with reasons.
    attempts:
        How often each view has failed.
    detections:
        Boards found in this session.
    """

    todo: deque[int]
    done: set[int] = field(default_factory=set)
    skipped: dict[int, str] = field(default_factory=dict)
    attempts: dict[int, int] = field(default_factory=dict)
    detections: dict[int, Detection] = field(default_factory=dict)


@dataclass
class TimeLeft:
    """Guesses the time left from the moves' least times and what the views took beyond them.

    Attributes
    ----------
    move_s:
        Least time of the move to each view of the plan.
    """

    move_s: Sequence[float]
    began_s: float
    at_start: int

    def estimate_s(self, progress: Progress, now_s: float) -> float | None:
        """Time left in seconds, None before the first view is done."""
        taken = len(progress.done) + len(progress.skipped) - self.at_start
        if taken <= 0:
            return None
        finished = progress.done | set(progress.skipped)
        moving_s = sum(self.move_s[index] for index in finished) * taken / len(finished)
        beyond_s = max(0.0, now_s - self.began_s - moving_s) / taken
        return sum(self.move_s[index] + beyond_s for index in progress.todo)
