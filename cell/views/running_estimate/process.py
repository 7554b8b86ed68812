"""The estimate in a process of its own: a fit of seconds must not keep the loop from the arm."""

from __future__ import annotations

import logging
import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType

from calib.views import FloatArray
from cell.errors import InputError
from cell.sequencer.stop import FROM_TERMINAL
from cell.sequencer.watcher import Checked, Watcher
from cell.storage.files.plan_file import Plan
from cell.storage.recording import FrameRecord, read_recording
from cell.storage.recording.detect import detect_corners
from cell.views.running_estimate.early_end import EarlyEnd
from cell.views.running_estimate.estimate import FEWEST_FRAMES, Estimate, Estimator
from cell.views.running_estimate.view_kinds import planned_flange_poses

log = logging.getLogger(__name__)

_END_S = 1.0
_LESS_URGENT = 5
_BEFORE_THE_LAST = 2
"""Frames left out of the first of the two estimates of a run that is gone on with."""


@dataclass(frozen=True)
class _CaughtUp:
    """Sent once the frames recorded before are estimated."""


_Found = tuple[FrameRecord, FloatArray, FloatArray]


class RunningEstimate(Watcher):
    """Estimates while a run goes on; use it as a context manager.

    Parameters
    ----------
    plan:
        The run's plan.
    recorded:
        Folder of a recording that is gone on with, or None.
    goal:
        Heeds every estimate, where the plan may end early.

    Raises
    ------
    InputError
        As `planned_flange_poses` does.
    """

    def __init__(self, plan: Plan, recorded: Path | None, goal: EarlyEnd | None) -> None:
        self._goal, self._ending = goal, False
        self._heard: list[Callable[[Estimate], None]] = [] if goal is None else [goal.heed]
        self._frames: queue.SimpleQueue[_Found | None] = queue.SimpleQueue()
        context = multiprocessing.get_context("spawn")
        self._link, self._there = context.Pipe()
        self._process = context.Process(
            target=_serve,
            args=(self._there, plan, planned_flange_poses(plan), recorded),
            name="estimate",
            daemon=True,
        )
        self._threads = [
            threading.Thread(target=work, name="estimate", daemon=True)
            for work in (self._send, self._receive)
        ]

    def on_estimate(self, heard: Callable[[Estimate], None]) -> None:
        """Hand `heard` every estimate too, from a thread of its own."""
        self._heard.append(heard)

    def checked(self, checked: Checked) -> None:
        """A good frame goes to the estimate."""
        found = checked.verdict.detection
        if checked.record is not None and found is not None:
            self._frames.put((checked.record, found.corners_px, found.sigma_px))

    def __enter__(self) -> RunningEstimate:
        self._process.start()
        self._there.close()
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ending = True
        self._frames.put(None)
        self._process.terminate()
        self._process.join(_END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        for thread in self._threads:
            thread.join(_END_S)
        self._link.close()

    def _send(self) -> None:
        try:
            while (found := self._frames.get()) is not None:
                self._link.send(found)
        except OSError:
            return  # the process is gone, which the other thread reports

    def _receive(self) -> None:
        try:
            while True:
                reported = self._link.recv()
                if isinstance(reported, Estimate):
                    self._publish(reported)
                elif self._goal is not None:
                    self._goal.catch_up()
        except (EOFError, OSError):
            if not self._ending:
                log.warning("the running estimate has died; the run takes all its views")
        finally:
            if self._goal is not None:
                self._goal.catch_up()

    def _publish(self, estimate: Estimate) -> None:
        for heard in tuple(self._heard):
            try:
                heard(estimate)
            except Exception as fault:  # one that fails must not keep the goal from hearing
                self._heard.remove(heard)
                log.warning("an estimate could not be shown: %s", fault)


def _serve(link: Connection, plan: Plan, planned_poses: FloatArray, recorded: Path | None) -> None:
    """In the process: estimate whenever there is something new, until the other end is gone."""
    # Ctrl-C and a closed terminal reach the whole group; the run decides when this ends
    for number in FROM_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
    os.nice(_LESS_URGENT)
    estimator = Estimator(plan, planned_poses)
    try:
        if recorded is not None:
            _look_back(link, estimator, recorded)
        link.send(_CaughtUp())
        while True:
            estimator.add(*link.recv())
            while link.poll():
                estimator.add(*link.recv())
            if len(estimator) >= FEWEST_FRAMES:
                link.send(estimator.estimate())
    except (EOFError, OSError):
        return


def _look_back(link: Connection, estimator: Estimator, recorded: Path) -> None:
    """Find the board in the pictures of before; two estimates, as a run would have made."""
    try:
        recording = read_recording(recorded)
    except InputError:
        return  # nothing was recorded yet
    corners = detect_corners(recording)
    for frame in recording.frames:
        if frame.frame in corners.px:
            estimator.add(frame, corners.px[frame.frame], corners.sigma_px[frame.frame])
    for left_out in (_BEFORE_THE_LAST, 0):
        if len(estimator) - left_out >= FEWEST_FRAMES:
            link.send(estimator.estimate(len(estimator) - left_out))
