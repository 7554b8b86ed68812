"""What the page knows of the run: each part replaced whole, so that nobody ever waits for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cell.sequencer.requests import Requests
from cell.sequencer.states import RunResult, State, Status
from cell.sequencer.stop import StopRequest
from cell.sequencer.watcher import Checked, Watcher
from cell.storage.files.plan_file import Plan
from cell.views.page.coverage import Coverage
from cell.views.page.messages import Messages
from cell.views.page.parts import camera_part, estimate_part, frame_part, run_part
from cell.views.running_estimate.estimate import Estimate
from drivers.arm import ArmState

SILENT_S = 2.0
"""The loop reads the arm every few milliseconds; after so long without, it hangs."""

_NO_ARM = (State.IDLE, State.CONNECTING, State.FINISHED)


@dataclass(frozen=True)
class Part:
    """One part of the page's content, with a number that grows whenever it changes."""

    version: int
    content: Mapping[str, Any]


class LiveRun(Watcher):
    """A run as the page shows it; the server only reads it, and sets the requests.

    Attributes
    ----------
    stop, requests:
        What the buttons set.
    parts:
        By name: `run`, `frame`, `camera`, `coverage`, `estimate`, `messages`, `end`.
    picture:
        The picture looked at last with its frame's number, or None.
    status:
        The run's last status, or None before its first.
    over:
        Whether the arm was let go of: the buttons have nothing to act on any more.
    """

    def __init__(self, plan: Plan, *, simulated: bool, folder: str) -> None:
        self.stop, self.requests = StopRequest(), Requests()
        self.status: Status | None = None
        self.picture: tuple[int, NDArray[np.generic]] | None = None
        self.over = False
        self._plan = plan
        self._arm: ArmState | None = None
        self._read_s = time.monotonic()
        self._messages = Messages()
        self._coverage, self._covering = Coverage.of(plan), threading.Lock()
        self._history: tuple[tuple[int, float], ...] = ()
        self.parts: dict[str, Part] = {}
        self._set("run", run_part(plan, simulated=simulated, folder=folder))
        self._set("coverage", self._coverage.content())

    # -- the run's side: quick, from its own threads -------------------------------------------

    def status_changed(self, status: Status) -> None:
        """See `Watcher.status_changed`."""
        self.status = status
        if status.event:
            self.say(status.event)
        if status.state is State.FINISHED:
            self.over = True

    def read(self, state: ArmState) -> None:
        """See `Watcher.read`."""
        self._arm, self._read_s = state, time.monotonic()

    def checked(self, checked: Checked) -> None:
        """See `Watcher.checked`."""
        number = self.parts["frame"].version + 1 if "frame" in self.parts else 1
        self.picture = number, checked.shot.frame.image
        name = self._plan.view_name(checked.shot.index)
        self._set("camera", camera_part(checked.shot.frame))
        self._set("frame", frame_part(checked, number, name, self._plan))
        if checked.record is not None:
            with self._covering:
                self._coverage.see(checked)
                self._set("coverage", self._coverage.content())

    def estimated(self, estimate: Estimate) -> None:
        """Take in a new estimate, from its thread."""
        if estimate.sigma_px.size:
            self._history = (*self._history, (estimate.used, estimate.worst_sigma_px))
        if estimate.transforms is not None:
            with self._covering:
                self._coverage.place(estimate.transforms)
                self._set("coverage", self._coverage.content())
        self._set("estimate", estimate_part(estimate, self._history, self._plan.file.until))

    def say(self, text: str) -> None:
        """A line for the operator."""
        self._messages.add(text)
        self._set("messages", {"lines": self._messages.lines()})

    def recorded(self, result: RunResult) -> None:
        """How the recording ended; the evaluation may follow."""
        self.over = True
        text = result.finish.text
        self._set("end", {"words": text, "reason": result.reason or result.ended_early})

    def ended(self, text: str, files: Mapping[str, str]) -> None:
        """The program's last words, and the files it wrote, by what they are."""
        self.over = True
        ended = dict(self.parts["end"].content) if "end" in self.parts else {"words": text}
        self._set("end", ended | {"result": text, "files": dict(files), "final": True})

    # -- the page's side -------------------------------------------------------------------------

    def now(self) -> dict[str, Any]:
        """State of run and arm at this instant."""
        status, arm = self.status, self._arm
        state = State.IDLE if status is None else status.state
        silent_s = 0.0 if state in _NO_ARM else time.monotonic() - self._read_s
        return {
            "at": time.time(),
            "state": state.value,
            "over": self.over,
            "silent_s": round(silent_s, 1) if silent_s > SILENT_S else 0,
            "asked": {
                "stop": self.stop.asked,
                "pause": self.requests.paused,
                "skip": status is not None
                and status.index is not None
                and self.requests.skips(status.index),
            },
            **({} if status is None else _status(status)),
            **({} if arm is None else {"arm": _arm(arm)}),
        }

    def _set(self, name: str, content: Mapping[str, Any]) -> None:
        before = self.parts.get(name)
        self.parts[name] = Part(1 if before is None else before.version + 1, content)


def _status(status: Status) -> dict[str, Any]:
    return {
        "view": status.view,
        "index": status.index,
        "done": status.done,
        "skipped": status.skipped,
        "total": status.total,
        "left_s": status.left_s,
    }


def _arm(arm: ArmState) -> dict[str, Any]:
    joints = () if arm.joints_rad is None else np.degrees(arm.joints_rad).tolist()
    return {
        "motion": arm.motion.value,
        "fault": arm.fault,
        "joints_deg": [round(x, 1) for x in joints],
        "place_m": [round(float(x), 3) for x in arm.base_from_flange.translation],
    }
