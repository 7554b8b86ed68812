"""The state machine that owns the arm; its states are drawn in `cell.sequencer.states`.

One thread runs the loop and is the only one that talks to the arm, every few milliseconds. What
may block (camera, frame check, disk) is done by a worker meanwhile. Whatever goes wrong, the arm
is stopped before anything else happens.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np

from calib.views import FloatArray
from cell.errors import BadAnswer, DiskFailed, exit_status_of
from cell.sequencer.checks import Verdict, check_frame, check_size, make_check_ready
from cell.sequencer.clock import Clock, HostClock
from cell.sequencer.goal import Goal
from cell.sequencer.guard import Guard
from cell.sequencer.guide import Guide
from cell.sequencer.journal import Journal
from cell.sequencer.progress import Progress, TimeLeft
from cell.sequencer.reading_watch import ARRIVING_RAD
from cell.sequencer.requests import SKIPPED_BY_OPERATOR, Requests
from cell.sequencer.shot import Shot
from cell.sequencer.states import RunResult, State, Status, finish_of
from cell.sequencer.stop import StopRequest
from cell.sequencer.watched_arm import POLL_S, WatchedArm, joints_of
from cell.sequencer.watched_camera import CameraLost, asked_of_camera
from cell.sequencer.watcher import Checked, Watcher, Watchers
from cell.sequencer.worker import Worker
from cell.storage.files.plan_file import Plan
from cell.storage.recording import FrameRecord, RecordingWriter
from drivers.arm import Arm, ArmState
from drivers.camera import Camera, FocusSetting, Frame
from drivers.errors import DeviceUnreachable, FrameMissing

_LAST_FRAME_S = 30.0


@dataclass(frozen=True)
class Devices:
    """The arm, the camera, and the clock their `host_t_s` counts on.

    `remember` takes the frames that an interrupted run has recorded: simulated devices go on from
    there as if nothing had happened; real ones have no need of it.
    """

    arm: Arm
    camera: Camera
    clock: Clock = field(default_factory=HostClock)
    remember: Callable[[Sequence[FrameRecord]], None] | None = None


class Sequencer:
    """Runs a plan once; see `run`.

    Parameters
    ----------
    plan:
        The plan and its cell.
    devices:
        Arm, camera, clock; connected by the run, and let go by it.
    writer, journal:
        Where frames and events go.
    progress:
        What a resumed run has behind it; everything lies ahead where not given.
    started_s:
        Time of `devices.clock` at which the recording's own clock is 0; now, where not given.
    stop, requests:
        Asked to stop, to pause, to give a view up by others.
    watchers:
        Who is notified of what happens.
    goal:
        What may end the run before it has taken all views; nothing does where not given.
    guide:
        Adds views to the plan while it runs, and watches too.
    """

    def __init__(
        self,
        plan: Plan,
        devices: Devices,
        writer: RecordingWriter,
        journal: Journal,
        *,
        progress: Progress | None = None,
        started_s: float | None = None,
        stop: StopRequest | None = None,
        requests: Requests | None = None,
        watchers: Iterable[Watcher] = (),
        goal: Goal | None = None,
        guide: Guide | None = None,
    ) -> None:
        self._plan, self._guide = plan, guide
        self._camera, self._clock = devices.camera, devices.clock
        self._watchers = Watchers(watchers if guide is None else (guide, *watchers))
        self._requests = Requests() if requests is None else requests
        self._arm = WatchedArm(
            devices.arm,
            Guard.of(plan) if guide is None else guide.guard,
            devices.clock,
            StopRequest() if stop is None else stop,
            self._watchers.read,
        )
        self._writer, self._journal = writer, journal
        self._progress = progress or Progress(deque(range(len(plan.file.views))))
        self._started_s = self._clock.now() if started_s is None else started_s
        self._worker = Worker()
        self._goal, self._ended_early = goal, ""
        self._stands = ""
        self._state = State.IDLE
        self._index: int | None = None
        self._checking: tuple[Shot, Future[Verdict]] | None = None
        self._time_left = TimeLeft([0.0] * len(plan.file.views), self._clock.now(), 0)

    def run(self) -> RunResult:
        """Take every view that is not done yet.

        Returns
        -------
        How it ended; errors of devices, limits and input are part of it. What nobody foresaw is
        raised again once the arm has stopped and the journal is closed.
        """
        error: BaseException | None = None
        try:
            self._connect()
            self._take_views()
        except BaseException as fault:
            error = fault
        last_s = time.monotonic() + _LAST_FRAME_S
        error = self._stop_arm(error, last_s)
        if error is not None:
            self._notify(State.STOPPING)
            with suppress(DiskFailed):
                self._keep_the_frame_in_hand(last_s)
        self._let_go()
        finish = finish_of(error, len(self._progress.skipped))
        reason = str(error or "") or (type(error).__name__ if error else "")
        if isinstance(error, DeviceUnreachable) and self._stands:
            reason = f"{reason.rstrip('.')}. Afterwards {self._stands}."
        self._note("stop", finish=finish.name.lower(), reason=reason or self._ended_early)
        self._notify(State.FINISHED)
        if error is not None and exit_status_of(error) is None:
            raise error
        progress = self._progress
        return RunResult(
            finish,
            reason,
            len(progress.done),
            dict(progress.skipped),
            dict(progress.detections),
            "" if error else self._ended_early,
        )

    def _stop_arm(self, fault: BaseException | None, last_s: float) -> BaseException | None:
        """Stop the arm, at a fault or at the end; returns what the operator must read first.

        Until `time.monotonic` is `last_s` it is watched while a frame is in hand.
        """
        error, word = self._arm.stop(fault)
        if word is not None:
            self._note("halt", **vars(word))
            if fault is not None and word.stands:
                self._notify(State.STOPPING, word.text)
            if word.stands:
                self._stands = word.text
                return self._stand_by(error, last_s)
        return error

    def _stand_by(self, error: BaseException | None, last_s: float) -> BaseException | None:
        """Watch the arm while the frame in hand is checked; returns what is reported first then."""
        job = self._checking[1] if self._checking else None

        def busy() -> bool:
            if job is not None:
                wait([job], timeout=POLL_S)
            return job is not None and not job.done() and time.monotonic() < last_s

        moved = self._arm.stand_by(busy)
        if moved is None:
            return error
        self._note("moved again", **vars(moved[1]))
        return moved[0]

    # -- one view after the other ------------------------------------------------------------

    def _connect(self) -> None:
        self._notify(State.CONNECTING)
        # before there is an arm to watch: a compiler keeps every other thread from running
        make_check_ready(self._plan.file.checks)
        start = self._arm.connect()
        joints = self._arm.guard.check_plan(self._plan, start)
        moves = pairwise((start, *joints))
        self._time_left = TimeLeft(
            [self._arm.guard.move_time_s(here, there) for here, there in moves],
            self._clock.now(),
            len(self._progress.done) + len(self._progress.skipped),
        )
        self._arm.await_job(self._worker.do(self._camera.connect))
        exposure = self._plan.file.exposure
        if exposure.exposure_s is not None or exposure.gain_db is not None:
            configure = partial(
                self._camera.configure, exposure_s=exposure.exposure_s, gain_db=exposure.gain_db
            )
            self._journal.write("configured", **self._arm.await_job(self._worker.do(configure)))

    def _take_views(self) -> None:
        progress = self._progress
        self._look_back()
        if not self._is_enough():
            self._come_from_the_view_before()
        while progress.todo or self._checking or self._one_more():
            if self._is_enough() or not progress.todo:
                self._notify(State.CHECKING)
                self._finish_check()
                continue
            index = progress.todo.popleft()
            came_from = self._go(index)
            self._finish_check()
            shot = self._shoot(index, came_from)
            if shot is not None:
                self._checking = shot, self._worker.do(partial(self._check_and_log, shot))

    def _look_back(self) -> None:
        """A run gone on with may have enough already: wait for the goal before any move."""
        if self._goal is not None and self._progress.done:
            self._notify(State.CHECKING, "looking whether the frames recorded before are enough")
            self._arm.await_job(self._goal.caught_up())

    def _is_enough(self) -> bool:
        """Whether the goal is reached; the views that are left are then dropped."""
        todo, reason = self._progress.todo, self._goal.reached() if self._goal else ""
        if reason and todo:
            self._ended_early = reason
            self._journal.write("enough", reason=reason, left=len(todo))
            todo.clear()
            self._notify(self._state, f"ending early: {reason}")
        return bool(reason)

    def _one_more(self) -> bool:
        """Whether the guide, asked now that every frame is judged, has added a view."""
        if self._guide is None or self._is_enough():
            return False
        view = self._arm.await_job(self._worker.do(self._guide.next_view))
        if view is None:
            return False
        views = self._plan.file.views
        file = self._plan.file.model_copy(update={"views": (*views, view)})
        self._plan = replace(self._plan, file=file)
        self._progress.todo.append(len(views))
        here = joints_of(self._arm.watch())
        there = self._arm.guard.joints_of(self._plan, len(views), here)
        move_s = self._arm.guard.move_time_s(here, there)
        self._time_left = replace(self._time_left, move_s=(*self._time_left.move_s, move_s))
        self._journal.write("decided", view=len(views), name=view.name, joints_rad=there.tolist())
        return True

    def _come_from_the_view_before(self) -> None:
        """A resumed run comes to its first view from where an unbroken one would have."""
        first = self._progress.todo[0] if self._progress.todo else 0
        if self._progress.done and first > 0 and not self._stands_at(first - 1):
            self._go(first - 1)

    def _stands_at(self, index: int) -> bool:
        here = joints_of(self._arm.watch())
        there = self._arm.guard.joints_of(self._plan, index, here)
        return float(np.abs(here - there).max()) < ARRIVING_RAD

    def _go(self, index: int) -> FloatArray:
        """Move to a view and settle there; returns the (6,) joint angles the move came from."""
        self._index = index
        self._pause_if_asked()
        self._notify(State.MOVING)
        here = joints_of(self._arm.watch())
        there = self._arm.guard.joints_of(self._plan, index, here)
        came_from = self._arm.go(there, self._plan.where(index))
        self._pause_if_asked()
        self._notify(State.SETTLING)
        self._arm.settle(self._plan.file.settle, self._plan.where(index))
        return came_from

    def _pause_if_asked(self) -> None:
        """Where the arm stands: wait while the operator wants it, the arm watched as ever."""
        if not self._requests.paused:
            return
        began_s = self._clock.now()
        self._journal.write("pause", view=self._index)
        self._notify(State.PAUSED, "paused; the arm stands at the end of its move")
        while self._requests.paused:
            self._arm.watch()
            self._requests.wait(POLL_S)
        self._journal.write("go on", view=self._index)
        self._time_left.began_s += self._clock.now() - began_s
        self._notify(State.PAUSED, "going on")

    def _shoot(self, index: int, came_from: FloatArray) -> Shot | None:
        """Focus and grab until image and pose belong together; None where the view is given up.

        A camera that is lost is opened anew, once a view, with the arm stopped before. The
        operator may give the view up until its picture is taken.
        """
        exposure = self._plan.file.exposure
        setting = FocusSetting(exposure.focus, self._plan.file.focus_position(index))
        focus = partial(self._camera.focus, setting)
        reopened = False
        while not self._requests.skips(index):
            try:
                self._notify(State.FOCUSING)
                self._arm.await_job(self._worker.do(asked_of_camera(focus)))
                self._notify(State.GRABBING)
                frame, states = self._grab(exposure.timeout_s)
                shot = Shot(index, frame, states, tuple(came_from.tolist()))
                fault = shot.pose_fault(self._plan.file.checks)
            except FrameMissing as lost:
                fault = str(lost)
            except CameraLost as lost:
                if reopened:
                    raise
                self._reopen_camera(index, lost)
                reopened = True
                continue
            if fault is None and not self._requests.skips(index):
                return shot
            if fault is not None and not self._again(index, fault):
                return None
        self._skip(index, SKIPPED_BY_OPERATOR)
        return None

    def _grab(self, timeout_s: float) -> tuple[Frame, tuple[ArmState, ...]]:
        """A frame, and the arm's readings from before its trigger to after it came."""
        states = [self._arm.watch()]
        grab = asked_of_camera(partial(self._camera.grab, timeout_s))
        frame = self._arm.await_job(self._worker.do(grab), states)
        check_size(frame.image, self._plan.cell.camera)
        states.append(self._arm.reading_after(frame.host_t_s))
        return frame, tuple(states)

    def _reopen_camera(self, index: int, lost: CameraLost) -> None:
        """Stop the arm, then open the camera anew; raises `DeviceError` where it stays away."""
        if not self._arm.halt().stands:
            raise lost from None  # the run ends, which stops the arm again and says what is known
        self._journal.write("camera lost", view=index, reason=str(lost))
        name = self._plan.view_name(index)
        self._notify(self._state, f"{name}: {lost}; opening the camera once more")
        self._arm.await_job(self._worker.do(self._camera.connect))
        self._arm.settle(self._plan.file.settle, self._plan.where(index))

    # -- checking and logging, while the arm goes on -----------------------------------------

    def _check_and_log(self, shot: Shot) -> Verdict:
        """In the worker: judge the picture; a good one is on the disk when this returns."""
        board = self._plan.cell.board.board()
        verdict = check_frame(shot.frame.image, board, self._plan.file.checks)
        record = None
        if verdict.fault is None:
            view = self._plan.file.views[shot.index]
            record = shot.record(view, self._started_s, verdict.detection)
            record = self._writer.append(record, shot.frame.image)
        self._watchers.checked(Checked(shot, verdict, record))
        return verdict

    def _finish_check(self) -> None:
        """Wait for the check of the frame taken before; a bad one's view is put next in line."""
        if self._checking is None:
            return
        shot, job = self._checking
        verdict = self._arm.await_job(job)
        self._checking = None
        if verdict.fault is None:
            self._count(shot.index, verdict)
        elif self._again(shot.index, verdict.fault):
            self._progress.todo.appendleft(shot.index)

    def _count(self, index: int, verdict: Verdict) -> None:
        self._progress.done.add(index)
        if verdict.detection is not None:
            self._progress.detections[index] = verdict.detection
        self._journal.write("frame", view=index)
        self._notify(self._state, f"frame {index} logged ({self._plan.view_name(index)})")

    def _again(self, index: int, fault: str) -> bool:
        """Whether a view that failed is to be taken again; skips or stops where it is not."""
        progress, retry = self._progress, self._plan.file.retry
        progress.attempts[index] = progress.attempts.get(index, 0) + 1
        name = self._plan.view_name(index)
        if progress.attempts[index] < retry.attempts:
            self._journal.write("retry", view=index, reason=fault)
            self._notify(self._state, f"{name}: {fault}; once more")
            return True
        if retry.then == "stop":
            raise BadAnswer(f"{name}: {fault} (tried {retry.attempts} times; retry.then is stop)")
        self._skip(index, fault)
        if not progress.done and len(progress.skipped) >= retry.give_up_after:
            raise BadAnswer(
                f"none of the first {len(progress.skipped)} views gave a usable frame; the last"
                f" one: {fault}. Check board, light and lens with one view before the next run."
            )
        return False

    def _skip(self, index: int, reason: str) -> None:
        self._progress.skipped[index] = reason
        self._journal.write("skip", view=index, reason=reason)
        self._notify(self._state, f"{self._plan.view_name(index)} skipped: {reason}")

    def _keep_the_frame_in_hand(self, last_s: float) -> None:
        """A whole frame that is being checked as the run ends is logged if it is good."""
        if self._checking is None:
            return
        shot, job = self._checking
        wait([job], timeout=max(0.0, last_s - time.monotonic()))
        if job.done() and job.exception() is None and job.result().fault is None:
            self._count(shot.index, job.result())

    def _let_go(self) -> None:
        """Release arm and camera; a fault of theirs is journalled and hides nothing."""
        for name, close in (("arm", self._arm.arm.close), ("camera", self._camera.close)):
            try:
                close()
            except Exception as fault:
                self._note("close failed", device=name, reason=str(fault))

    def _note(self, event: str, **values: object) -> None:
        """Journal what nothing depends on; a full disk must not keep the run from ending."""
        with suppress(DiskFailed):
            self._journal.write(event, **values)

    def _notify(self, state: State, event: str | None = None) -> None:
        """Notify the watchers; one that fails (a terminal that is gone) is not notified again."""
        self._state = state
        progress = self._progress
        status = Status(
            state,
            "" if self._index is None else self._plan.view_name(self._index),
            len(progress.done),
            len(progress.skipped),
            len(self._plan.file.views),
            self._time_left.estimate_s(progress, self._clock.now()),
            event,
            self._index,
        )
        self._watchers.status_changed(status)
        while self._watchers.failures:
            self._note("listener failed", reason=self._watchers.failures.pop())
