"""The arm under watch: every wait polls it, and whatever goes wrong stops it first."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from calib.views import FloatArray
from cell.errors import StoppedByOperator
from cell.sequencer.as_configured import check_as_configured
from cell.sequencer.clock import Clock
from cell.sequencer.confirmed_stop import ConfirmedStop, StopReport
from cell.sequencer.guard import Guard
from cell.sequencer.reading_watch import ARRIVING_RAD, STANDING_RAD, ReadingWatch
from cell.sequencer.rest import fastest_rad_s
from cell.sequencer.same_arm import check_same_arm
from cell.sequencer.stop import StopRequest
from cell.storage.files.plan_file import Settle
from drivers.arm import Arm, ArmState, Motion
from drivers.errors import ArmStopped, DeviceError, SafetyError, StopFailed

POLL_S = 0.008
READING_PATIENCE_S = 1.0
_MOVE_PATIENCE = 3.0
_MOVE_SLACK_S = 15.0
_NOT_REACHED = "No motion was ordered; should the arm move, it is not by this program."
_MOVED_AGAIN = (
    "The arm moved again after it had been stopped and had stood. Look what moves it: a program"
    " that was gone on with at its pendant, another program, a person."
)
STAND_BY_S = 1.0
"""A stop that was confirmed is watched for so long, before the arm is let go."""
_UNDERWAY_RAD_S, _SURE_SHARE = 0.02, 0.3

Result = TypeVar("Result")


@dataclass
class WatchedArm:
    """Moves an arm as the guard allows, from one thread, a few milliseconds at a time.

    Attributes
    ----------
    arm, guard, clock:
        The arm, what it may do, and the clock its `host_t_s` counts on.
    stop_request:
        Looked at in every wait.
    on_reading:
        Called with every reading; must not raise or block.
    connected:
        Whether `connect` succeeded: from then on every fault stops the arm.
    """

    arm: Arm
    guard: Guard
    clock: Clock
    stop_request: StopRequest
    on_reading: Callable[[ArmState], None] = lambda state: None
    connected: bool = field(default=False, init=False)
    _newest: ArmState | None = field(default=None, init=False)
    _previous: ArmState | None = field(default=None, init=False)
    _goal_rad: FloatArray | None = field(default=None, init=False)
    _readings: ReadingWatch = field(init=False)

    def __post_init__(self) -> None:
        self._readings = ReadingWatch(self.guard)

    def connect(self) -> FloatArray:
        """Open the link; returns the (6,) joint angles the arm stands at.

        Raises `SafetyError` where it is not the arm that the guard knows, or is set otherwise.
        """
        try:
            self.arm.connect()
        except DeviceError as fault:
            raise type(fault)(f"{str(fault).rstrip('.')}. {_NOT_REACHED}") from None
        self.connected = True
        state = self.watch()
        check_same_arm(self.guard.kinematics, state)
        check_as_configured(self.guard.cell.robot, self.guard.kinematics, state.raw)
        return joints_of(state)

    def watch(self) -> ArmState:
        """The arm's state.

        Raises
        ------
        StoppedByOperator
            Somebody asked for a stop.
        ArmStopped, DeviceUnreachable
            The arm stopped by itself, or its readings are stale.
        SafetyError
            It is not where it was ordered to be, or its readings cannot be: see `ReadingWatch`.
        """
        if self.stop_request.asked:
            raise StoppedByOperator(f"stopped by {self.stop_request.reason}")
        state = self.arm.state()
        self.on_reading(state)
        self._remember(state)
        if state.motion is Motion.STOPPED_BY_FAULT or state.fault is not None:
            raise ArmStopped(state.fault or "the arm stopped by itself and does not say why")
        if state.joints_rad is not None:
            self._readings.check(state)
        return state

    def _remember(self, state: ArmState) -> None:
        if self._newest is None or state.host_t_s > self._newest.host_t_s:
            self._previous, self._newest = self._newest, state

    def _least_way_rad(self, fault: BaseException | None) -> float:
        """How far it must have gone since the newest reading; below 0 where it may not have."""
        newest, goal = self._newest, self._goal_rad
        if newest is None or newest.joints_rad is None or goal is None:
            return -1.0
        if isinstance(fault, ArmStopped) and newest.joint_velocity_rad_s is None:
            return -1.0  # it stopped by itself, maybe before that reading, which has no speed
        speed_rad_s = self._speed_rad_s(newest)
        left_rad = float(np.abs(np.subtract(newest.joints_rad, goal)).max())
        if not (speed_rad_s > _UNDERWAY_RAD_S and left_rad > ARRIVING_RAD):
            return -1.0
        age_s = self.clock.now() - newest.host_t_s
        # nothing but the operator's order can have stopped it
        undisturbed = isinstance(fault, StoppedByOperator)
        return _SURE_SHARE * speed_rad_s * max(age_s, 0.0) if undisturbed else 0.0

    def _speed_rad_s(self, newest: ArmState) -> float:
        """Of the fastest joint, as the controller reports it or as its readings do."""
        previous = self._previous
        if newest.joint_velocity_rad_s is not None:
            return fastest_rad_s(newest)
        if previous is None or previous.joints_rad is None:
            return 0.0
        moved_rad = np.abs(np.subtract(newest.joints_rad or (), previous.joints_rad)).max()
        return float(moved_rad) / (newest.host_t_s - previous.host_t_s)

    def await_job(self, job: Future[Result], states: list[ArmState] | None = None) -> Result:
        """A job's result, the arm being watched meanwhile; its readings go to `states`."""
        while not job.done():
            state = self.watch()
            if states is not None:
                states.append(state)
            wait([job], timeout=POLL_S)
        return job.result()

    def reading_after(self, host_t_s: float) -> ArmState:
        """The first reading that is not older than that time; some controllers report seldom.

        After `READING_PATIENCE_S` without one the newest reading is returned as it is.
        """
        began_s = self.clock.now()
        while True:
            state = self.watch()
            if state.host_t_s >= host_t_s or self.clock.now() - began_s > READING_PATIENCE_S:
                return state
            self.clock.sleep(POLL_S)

    def go(self, there: FloatArray, where: str) -> FloatArray:
        """Move to (6,) joint angles; returns those the move came from.

        Raises
        ------
        SafetyError
            The guard refuses the move; the arm has not moved.
        DeviceError
            It does not arrive.
        """
        here = joints_of(self.watch())
        target = self.guard.target(here, there, where)
        ordered_s = self.clock.now()
        self._goal_rad = there
        self._readings.moves(here, there, target.joint_speed_rad_s)
        self.arm.start_move(target)
        patience_s = _MOVE_PATIENCE * self.guard.move_time_s(here, there) + _MOVE_SLACK_S
        while True:
            self.clock.sleep(POLL_S)
            state = self.watch()
            off = float(np.abs(joints_of(state) - there).max())
            if state.host_t_s > ordered_s and state.motion is Motion.STEADY and off < ARRIVING_RAD:
                self._readings.stands(there, ARRIVING_RAD)
                return here
            if self.clock.now() - ordered_s > patience_s:
                raise DeviceError(
                    f"{where}: the arm did not arrive within {patience_s:.0f} s; the joint farthest"
                    f" from its target is {np.degrees(off):.1f}° off. Look what holds it up."
                )

    def settle(self, settle: Settle, where: str) -> None:
        """Wait until the arm has reported for long enough that it stands still."""
        began_s = self.clock.now()
        still_since_s: float | None = None
        while True:
            state = self.watch()
            if state.motion is not Motion.STEADY:
                still_since_s = None
            elif still_since_s is None:
                still_since_s = state.host_t_s
            if still_since_s is not None and state.host_t_s - still_since_s >= settle.still_s:
                self._readings.stands(joints_of(state))
                return
            if self.clock.now() - began_s > settle.timeout_s:
                raise DeviceError(
                    f"{where}: the arm does not come to rest within {settle.timeout_s:.0f} s."
                    " Check its payload setting and its mounting."
                )
            self.clock.sleep(POLL_S)

    def halt(self, because: BaseException | None = None) -> StopReport:
        """Stop the arm; returns what readings say of it afterwards."""
        stop = ConfirmedStop(self.arm, self.clock, self.on_reading)
        least_way_rad = self._least_way_rad(because)
        word = stop.see_through(self._newest, least_way_rad=least_way_rad)
        self._goal_rad = None
        return word

    def stop(self, fault: BaseException | None) -> tuple[BaseException | None, StopReport | None]:
        """Stop the arm before all else, at a fault or at the end of a run.

        Returns
        -------
        What the operator must read first, and the word of the stop; None for an arm that was
        never reached.
        """
        if not self.connected:
            return fault, None
        word = self.halt(fault)
        if word.stands:
            return fault, word
        because = "the run was over" if fault is None else str(fault) or type(fault).__name__
        return _shouted(word, f"It was to be stopped because: {because}"), word

    def stand_by(self, busy: Callable[[], bool]) -> tuple[SafetyError, StopReport] | None:
        """Watch an arm that was stopped, for `STAND_BY_S` and as long as something is `busy`.

        Returns
        -------
        What the operator must read of one that moved again, and the word of the stop that it
        was then given; None where it stood, or nothing can be read any more.
        """
        until_s = self.clock.now() + STAND_BY_S
        with suppress(Exception):  # as long as it can be read
            stood = joints_of(self.arm.state())
            while busy() or self.clock.now() < until_s:
                self.clock.sleep(POLL_S)
                state = self.arm.state()
                self.on_reading(state)
                if float(np.abs(joints_of(state) - stood).max()) > STANDING_RAD:
                    word = self.halt()
                    if not word.stands:
                        return _shouted(word, _MOVED_AGAIN), word
                    return SafetyError(f"{_MOVED_AGAIN} It was stopped again: {word.text}."), word
        return None


def _shouted(word: StopReport, because: str) -> StopFailed:
    """What the operator must read first, shown at once."""
    with suppress(OSError):  # a terminal that is gone must not hide the rest
        sys.stderr.write(f"\a\n*** {word.text} ***\n")
        sys.stderr.flush()
    return StopFailed(f"{word.text} {because}")


def joints_of(state: ArmState) -> FloatArray:
    """(6,) joint angles; raises `DeviceError` for an arm that does not report them."""
    if state.joints_rad is None:
        raise DeviceError("the arm does not report its joint angles; a run cannot be checked")
    return np.asarray(state.joints_rad, dtype=float)
