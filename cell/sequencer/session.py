"""A run of a plan into a recording's folder: begun anew, or gone on with."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cell.sequencer.goal import Goal
from cell.sequencer.guide import Guide
from cell.sequencer.journal import Journal, check_same_plan, skipped_views
from cell.sequencer.progress import Progress
from cell.sequencer.requests import Requests
from cell.sequencer.sequencer import Devices, Sequencer
from cell.sequencer.states import Finish, RunResult
from cell.sequencer.stop import StopRequest, signals_ask
from cell.sequencer.watcher import Watcher
from cell.storage.files.camera_file import CameraFile
from cell.storage.files.cell_file import SimulatedRobot
from cell.storage.files.plan_file import Plan
from cell.storage.files.provenance import made_by
from cell.storage.recording import FrameRecord, Header, RecordingWriter
from cell.storage.recording.corners import FILE_NAME as DETECTIONS


def record_plan(
    plan: Plan,
    folder: Path,
    devices: Devices,
    *,
    simulated: bool = False,
    resume: bool = False,
    stop: StopRequest | None = None,
    requests: Requests | None = None,
    watchers: Iterable[Watcher] = (),
    goal: Goal | None = None,
    guide: Guide | None = None,
) -> RunResult:
    """Run a plan into `folder`, from the main thread; signals stop it.

    Parameters
    ----------
    plan, folder, devices:
        What to do, where it is recorded, and with what.
    simulated:
        Whether the devices are; simulated and real frames are never mixed.
    resume:
        Go on with what `folder` has.
    stop, requests, watchers, goal, guide:
        See `Sequencer`.

    Raises
    ------
    InputError
        A recording is there already, or there is none to resume, or its plan was another.
    """
    stop = StopRequest() if stop is None else stop
    begin = _resume if resume else _begin
    writer, journal, progress, elapsed_s = begin(plan, folder, simulated, devices)
    with writer, signals_ask(stop):
        sequencer = Sequencer(
            plan,
            devices,
            writer,
            journal,
            progress=progress,
            started_s=devices.clock.now() - elapsed_s,
            stop=stop,
            requests=requests,
            watchers=watchers,
            goal=goal,
            guide=guide,
        )
        try:
            result = sequencer.run()
            if result.finish is not Finish.DEVICE_FAILED:
                writer.check_complete()
            writer.say(ended_early=result.ended_early or None)
            return result
        finally:
            journal.close()


Begun = tuple[RecordingWriter, Journal, Progress, float]


def _begin(plan: Plan, folder: Path, simulated: bool, devices: Devices) -> Begun:
    header = header_of(plan, simulated=simulated)
    begun = header.model_copy(update={"created": made_by()["created"]})
    writer = RecordingWriter.create(folder, begun)
    journal = Journal(folder)
    journal.write(
        "start",
        plan=plan.file.name,
        plan_sha256=plan.sha256,
        simulated=simulated,
        unix_s=time.time(),
        version=version("calibration-cell"),
        views=len(plan.file.views),
    )
    return writer, journal, Progress(deque(range(len(plan.file.views)))), 0.0


def _resume(plan: Plan, folder: Path, simulated: bool, devices: Devices) -> Begun:
    events = check_same_plan(folder, plan, simulated=simulated)
    journal = Journal(folder)
    writer, frames = RecordingWriter.resume(folder)
    done = {frame.frame for frame in frames}
    skipped = skipped_views(events)
    _set_detections_aside(folder)
    todo = [i for i in range(len(plan.file.views)) if i not in done and i not in skipped]
    journal.write("resume", done=len(done), skipped=len(skipped), todo=len(todo))
    began = Progress(deque(todo), done, skipped)
    if devices.remember is not None and frames:
        devices.remember(frames)
        return writer, journal, began, devices.clock.now()
    return writer, journal, began, _elapsed_s(events, frames, simulated)


def _set_detections_aside(folder: Path) -> None:
    """Corners found before the run went on would stand for the whole of it."""
    stale = folder / DETECTIONS
    if stale.exists():
        stale.replace(folder / f"{stale.stem}-before-resume{stale.suffix}")


def _elapsed_s(
    events: list[dict[str, Any]], frames: tuple[FrameRecord, ...], simulated: bool
) -> float:
    """Seconds since the recording's clock was 0; a simulated cell's time stood still meanwhile.

    A computer's clock may have been set back meanwhile: no frame is older than the last one.
    """
    last_s = max((frame.t_s for frame in frames if frame.t_s is not None), default=0.0)
    if simulated:
        return last_s
    start = next(event for event in events if event.get("event") == "start")
    try:
        return max(last_s, time.time() - float(start["unix_s"]))
    except (KeyError, TypeError, ValueError):
        return last_s


def recorded_robot(robot: SimulatedRobot) -> dict[str, Any]:
    """The arm of a cell file in the words of `recording.yaml`."""
    settings: dict[str, Any] = {"model": robot.model, "payload_kg": robot.payload_kg}
    if robot.urdf is not None:
        settings |= {"urdf": robot.urdf, "base": robot.base, "flange": robot.flange}
    return settings


def _stated_serial(camera: CameraFile) -> dict[str, str]:
    """The camera's serial number where the cell file picks it out by that."""
    serial = getattr(camera, "serial", None)
    return {} if serial is None else {"serial": serial}


def header_of(plan: Plan, *, simulated: bool, images: bool = True) -> Header:
    """The `recording.yaml` of a plan's recording."""
    cell = plan.cell
    return Header.model_validate(
        {
            "schema": "cell.recording/1",
            "name": f"{plan.file.name}{' (simulated)' if simulated else ''}",
            "robot": recorded_robot(cell.robot),
            "camera": {
                "model": cell.camera.model,
                "width": cell.camera.width,
                "height": cell.camera.height,
                "pixel_size_um": cell.camera.pixel_size_um,
                "focus": cell.camera.focus,
            }
            | _stated_serial(cell.camera),
            "board": cell.board.model_dump(),
            "mount": cell.mount,
            "capture": {"mode": "stop"},
            "images": "images/" if images else None,
            "simulated": simulated,
            "plan": {"name": plan.file.name, "sha256": plan.sha256},
        }
    )
