"""The states of a run, and, apart from them, why it ended.

::

    IDLE ─→ CONNECTING ─→ MOVING ─→ SETTLING ─→ FOCUSING ─→ GRABBING ─┬─→ MOVING (next view;
               │           │  ↑│       │           │           │      │    the frame just taken is
               │           │  │↓       │           │           │      │    checked and logged
               │           │ PAUSED    │           │           │      │    meanwhile)
               │           │  │        │           │           │      └─→ CHECKING (the last one)
               └───────────┴──┴────────┴───────────┴───────────┴────────────┬──┘
                                  anything unexpected                       │ no view left, or
                                         ↓                                  ↓ enough of them
                              STOPPING (the arm first) ──────────────→ FINISHED
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from calib.detection.result import Detection
from cell.errors import (
    EXIT_BAD_ANSWER,
    EXIT_DEVICE,
    EXIT_DONE,
    EXIT_INPUT,
    EXIT_OPERATOR,
    EXIT_SAFETY,
    StoppedByOperator,
    exit_status_of,
)


class State(Enum):
    """What the run is doing."""

    IDLE = "idle"
    CONNECTING = "connecting"
    MOVING = "moving"
    PAUSED = "paused"
    SETTLING = "settling"
    FOCUSING = "focusing"
    GRABBING = "grabbing"
    CHECKING = "checking"
    STOPPING = "stopping"
    FINISHED = "finished"


class Finish(Enum):
    """Why a run ended, with the contract's exit status."""

    COMPLETED = ("completed", EXIT_DONE)
    COMPLETED_WITH_LOSSES = ("completed with losses", EXIT_BAD_ANSWER)
    GIVEN_UP = ("given up", EXIT_BAD_ANSWER)
    BAD_INPUT = ("bad input", EXIT_INPUT)
    DEVICE_FAILED = ("a device failed", EXIT_DEVICE)
    STOPPED_BY_OPERATOR = ("stopped by the operator", EXIT_OPERATOR)
    SAFETY = ("a safety limit", EXIT_SAFETY)
    UNFORESEEN = ("an unforeseen error", EXIT_BAD_ANSWER)

    def __init__(self, text: str, exit_status: int) -> None:
        self.text = text
        self.exit_status = exit_status


_FINISH_OF_STATUS = {
    EXIT_BAD_ANSWER: Finish.GIVEN_UP,
    EXIT_INPUT: Finish.BAD_INPUT,
    EXIT_DEVICE: Finish.DEVICE_FAILED,
    EXIT_SAFETY: Finish.SAFETY,
}


def finish_of(error: BaseException | None, skipped: int) -> Finish:
    """Why a run ended that raised `error` (or nothing) and gave up `skipped` views."""
    if error is None:
        return Finish.COMPLETED_WITH_LOSSES if skipped else Finish.COMPLETED
    if isinstance(error, StoppedByOperator):
        return Finish.STOPPED_BY_OPERATOR
    status = exit_status_of(error)
    return Finish.UNFORESEEN if status is None else _FINISH_OF_STATUS[status]


@dataclass(frozen=True)
class Status:
    """A snapshot for whoever watches: terminal, live page.

    Attributes
    ----------
    state:
        What the run is doing.
    view, index:
        The view it does it for, as words (empty before the first), and its number in the plan.
    done, skipped, total:
        Views with a logged frame, views given up, views of the plan.
    left_s:
        Estimated time left, seconds; None before anything was measured.
    event:
        What has just happened, if anything, as one line for the operator.
    """

    state: State
    view: str
    done: int
    skipped: int
    total: int
    left_s: float | None = None
    event: str | None = None
    index: int | None = None


@dataclass(frozen=True)
class RunResult:
    """How a run ended.

    Attributes
    ----------
    finish:
        Why it ended.
    reason:
        As text for the operator; empty when it is completed.
    ended_early:
        Why a completed run did not need all views of its plan; empty where it took them.
    frames:
        Number of frames in the recording.
    skipped:
        View number to the reason why it was given up.
    detections:
        Frame number to the board that its check found, in this session.
    """

    finish: Finish
    reason: str
    frames: int
    skipped: dict[int, str]
    detections: dict[int, Detection] = field(default_factory=dict)
    ended_early: str = ""
