"""One fault at one instant of a run, and whether everything then was as it must be."""

from __future__ import annotations

import logging
import re
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.fault_runs.faults import DEVICE, NOT_REACHED, SAFETY, Fault
from benchmarks.fault_runs.launch import Launch
from benchmarks.fault_runs.stands import Stand
from calib.detection import Detection, detect
from cell.storage.recording import Recording, read_recording
from cell.storage.recording.frames import FILE_NAME as FRAMES
from drivers.abb import FACTORY_LOGIN
from sim.log import Row, views_of
from sim.synthesize import true_corners

_POLL_S = 0.004
_END_S = 40.0
_REST_S = 0.3
_SURVIVES_S = 25.0
_OFF_PX = 0.5
_TRIES = 6
_log = logging.getLogger(__name__)
_TRIPPED = (
    r"silent for 0\.\d\d s|the watchdog ended it|no robot state for [12]\.\d s|had heard nothing"
    r"|could not log in|control script did not start|motors are off"
)


class Disturbed(Exception):
    """A busy machine tripped a watchdog of the UR driver, before the fault or in its place."""


@dataclass
class Trial:
    """What came of one fault.

    Attributes
    ----------
    moving, moved:
        Whether the arm moved when it happened, and whether the run had moved it by then.
    halted_s:
        How long the arm moved on after it.
    exit_status:
        Of the run.
    frames:
        In the recording afterwards.
    output:
        All that the run printed.
    complaints:
        What was not as it must be.
    """

    moving: bool
    moved: bool
    halted_s: float = 0.0
    exit_status: int | None = None
    frames: int = 0
    output: str = ""
    complaints: list[str] = field(default_factory=list)

    def demand(self, kept: bool, otherwise: str) -> None:
        """Complain unless it is so."""
        if not kept:
            self.complaints.append(otherwise)


def happening(stand: Stand, folder: Path, fault: Fault, instant_s: float) -> Trial | None:
    """`trial`, again where a busy machine ended the run before the fault did.

    None where it did so every time; all that is known of the fault then is that the arm stood
    and the recording was whole.
    """
    for _ in range(_TRIES):
        try:
            return trial(stand, folder, fault, instant_s)
        except Disturbed as ended:
            _log.warning("again: %s", ended)
    return None


def trial(stand: Stand, folder: Path, fault: Fault, instant_s: float) -> Trial:
    """Begin or go on with the recording, let the fault happen, look, and put it right.

    `instant_s` counts from the run's first motion; below zero, from its beginning.

    Raises
    ------
    Disturbed
        The run had ended by then, or ended for another reason.
    """
    before = _lines(folder)
    began_rad = stand.sim.truth().joints_rad
    launch = Launch(stand.plan.path, folder)
    try:
        _await(launch, stand, fault, instant_s)
        moved = not np.array_equal(stand.sim.truth().joints_rad, began_rad)
        came = Trial(stand.truly_moving(), moved)
        _watch(stand, folder, fault, launch, came)
    finally:
        launch.finish()
        fault.restore(stand, launch)
    came.exit_status, came.output = launch.exit_status, launch.output
    _judge(fault, came)
    _judge_recording(stand, folder, before, came)
    if came.complaints and re.search(_TRIPPED, came.output):
        raise Disturbed(came.output)
    return came


def _await(launch: Launch, stand: Stand, fault: Fault, instant_s: float) -> None:
    if not launch.began():
        raise Disturbed(launch.output)
    if instant_s >= 0.0:
        _until(stand.truly_moving, launch)
    due_s = time.monotonic() + abs(instant_s)
    _until(lambda: time.monotonic() >= due_s and fault.possible(stand, launch), launch)


def _until(condition: Callable[[], bool], launch: Launch) -> None:
    while not condition():
        if launch.ended:
            raise Disturbed(launch.output)
        time.sleep(_POLL_S)


def _watch(stand: Stand, folder: Path, fault: Fault, launch: Launch, came: Trial) -> None:
    """Let it happen and look at the arm until the run has ended and long enough after."""
    frames = len(_lines(folder))
    happened_s = time.monotonic()
    act = threading.Thread(target=fault.happen, args=(stand, launch))
    act.start()
    moved_s, ended_s = happened_s, None
    interrupted = False
    while ended_s is None or time.monotonic() < ended_s + _REST_S:
        now_s = time.monotonic()
        if stand.truly_moving():
            moved_s = now_s
        if ended_s is None and launch.ended:
            ended_s = now_s
        if fault.survived and not interrupted and not act.is_alive():
            interrupted = _interrupt_if_it_goes_on(launch, folder, frames, now_s - happened_s)
        if now_s - happened_s > _END_S:
            came.complaints.append(f"the run did not end within {_END_S:g} s")
            break
        time.sleep(_POLL_S)
    act.join()
    came.halted_s = moved_s - happened_s
    late_s = moved_s - (ended_s or moved_s)
    came.demand(late_s < _REST_S, f"the arm moved {late_s:.2f} s after the run's end")
    if fault.survived:
        came.demand(interrupted and len(_lines(folder)) > frames, "the run did not go on")


def _interrupt_if_it_goes_on(launch: Launch, folder: Path, frames: int, since_s: float) -> bool:
    # the frame that was in hand does not count, the one after it does
    if len(_lines(folder)) <= frames + 1 and since_s < _SURVIVES_S:
        return False
    launch.send(signal.SIGINT)
    return True


def _judge(fault: Fault, came: Trial) -> None:
    exits, patterns = (4,) if fault.survived else fault.exits, fault.patterns
    if exits == (SAFETY,) and not came.moved and came.exit_status == DEVICE:
        # the link was not up yet: nothing had been ordered, so that there was no stop to confirm
        exits, patterns = (DEVICE,), NOT_REACHED
    came.demand(came.exit_status in exits, f"exit status {came.exit_status}, not {exits}")
    came.demand("Traceback" not in came.output, "a traceback")
    if fault.halt_s is not None:
        late = f"the arm moved on for {came.halted_s:.2f} s, allowed are {fault.halt_s:g} s"
        came.demand(came.halted_s <= fault.halt_s, late)
    last = "\n".join(came.output.splitlines()[-4:])
    for pattern in patterns:
        came.demand(re.search(pattern, last) is not None, f"operator does not see '{pattern}'")


def _judge_recording(stand: Stand, folder: Path, before: list[bytes], came: Trial) -> None:
    came.demand(_lines(folder)[: len(before)] == before, "lines of the log were lost or changed")
    secret = FACTORY_LOGIN.password.encode()
    leaked = [file.name for file in folder.rglob("*.*") if secret in file.read_bytes()]
    came.demand(not leaked, f"the controller's password stands in {leaked}")
    if not _lines(folder):
        return
    recording = read_recording(folder)
    came.frames = len(recording.frames)
    numbers = [frame.frame for frame in recording.frames]
    came.demand(len(set(numbers)) == len(numbers), "a frame stands there twice")
    new = [frame.frame for frame in recording.frames][len(before) :]
    for frame, off_px in _off_px(stand, recording, new).items():
        came.demand(off_px < _OFF_PX, f"frame {frame} shows the board {off_px:.1f} px off")


def _off_px(stand: Stand, recording: Recording, numbers: list[int]) -> dict[int, float]:
    """How far the corners in each picture lie from where the logged pose puts them."""
    off = {}
    for frame in recording.frames:
        if frame.frame not in numbers:
            continue
        joints = np.array(frame.joints_rad)
        still = np.zeros(6)
        approach = np.array(frame.approach_joints_rad)
        row = Row(frame.t_s or 0.0, joints, still, approach, frame.exposure_s or 0.0)
        truth = true_corners(stand.truth, views_of(stand.truth, [row]))[0]
        found = detect(recording.image(frame), recording.board)
        difference = found.corners_px - truth if isinstance(found, Detection) else np.inf
        off[frame.frame] = float(np.sqrt(np.nanmean(np.square(difference))))
    return off


def _lines(folder: Path) -> list[bytes]:
    file = folder / FRAMES
    return file.read_bytes().splitlines(keepends=True) if file.exists() else []
