"""A whole run: record a plan, calibrate and diagnose what was recorded, write the report."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calib.chain.model import CellModel
from calib.detection import Detection
from cell.calibrate import calibrate_into, detect_corners
from cell.cli.output import say
from cell.cli.progress import run_progress
from cell.cli.summary import calibration_summary, diagnosis_summary
from cell.diagnose import diagnose_into
from cell.errors import BadAnswer
from cell.factory import peer_devices, real_devices, simulated_devices
from cell.files.plan_file import Plan, read_plan
from cell.recording import Corners, Recording, read_recording, write_corners
from cell.recording.corners import FILE_NAME as DETECTIONS
from cell.running_estimate.early_end import EarlyEnd
from cell.running_estimate.process import RunningEstimate
from cell.sequencer.sequencer import Devices
from cell.sequencer.session import record_plan
from cell.sequencer.states import Finish, RunResult
from cell.sequencer.watcher import Watcher
from cell.simulated import home_of, simulated_cell


def record(
    plan: Plan, folder: Path, *, dry_run: bool, resume: bool, peers: bool = False
) -> RunResult:
    """Run a plan into a recording, with its progress in the terminal.

    Parameters
    ----------
    dry_run, peers:
        Simulated devices; in this process, or behind the real drivers and their protocols.

    Raises
    ------
    InputError, SafetyError
        The cell cannot be used, or a recording is in the way.
    DeviceError
        `peers`, and a driver's packages are not installed or the peers do not start.
    """
    say(f"{_devices_are(dry_run, peers)}; plan {plan.path}; recording {folder}")
    goal = None if plan.file.until is None else EarlyEnd(plan.file.until)
    with ExitStack() as stack:
        devices = stack.enter_context(_devices(plan, dry_run, peers))
        watchers: list[Watcher] = [stack.enter_context(run_progress(simulated=dry_run))]
        if goal is not None:
            estimate = RunningEstimate(plan, folder if resume else None, goal)
            watchers.append(stack.enter_context(estimate))
        return record_plan(
            plan,
            folder,
            devices,
            simulated=dry_run,
            resume=resume,
            watchers=watchers,
            goal=goal,
        )


def _devices_are(dry_run: bool, peers: bool) -> str:
    through = " through the real drivers" if peers else ""
    return f"SIMULATED arm and camera{through}" if dry_run else "real arm and camera"


def _devices(plan: Plan, dry_run: bool, peers: bool) -> AbstractContextManager[Devices]:
    if peers:
        return peer_devices(plan)
    return nullcontext(simulated_devices(plan) if dry_run else real_devices(plan))


def truth_of(plan_path: Path) -> CellModel:
    """The simulated cell behind a plan's dry run."""
    plan = read_plan(plan_path)
    return simulated_cell(plan.cell, home_of(plan)).model


@dataclass(frozen=True)
class Outcome:
    """What a run came to.

    Attributes
    ----------
    complete:
        Every view was taken or given up: there is something to calibrate.
    text, mapping:
        For people, and for programs.
    """

    folder: Path
    complete: bool
    text: str
    mapping: dict[str, Any]

    @classmethod
    def of(cls, result: RunResult, folder: Path) -> Outcome:
        """The outcome of recording alone."""
        mapping = {
            "finish": result.finish.name.lower(),
            "reason": result.reason or None,
            "recording": str(folder),
            "frames": result.frames,
            "ended_early": result.ended_early or None,
            "skipped": [{"view": view, "reason": why} for view, why in result.skipped.items()],
        }
        lost = f", {len(result.skipped)} views skipped" if result.skipped else ""
        text = f"{result.finish.words}: {result.frames} frames{lost} in {folder}"
        if result.ended_early:
            text = f"{text}\nended early: {result.ended_early}"
        complete = result.finish in (Finish.COMPLETED, Finish.COMPLETED_WITH_LOSSES)
        return cls(folder, complete, text, mapping)


def evaluate(
    outcome: Outcome, result: RunResult, *, simulated: bool, truth: CellModel | None = None
) -> Outcome:
    """Calibrate and diagnose a finished run; the results go into the recording's folder.

    `truth` is the simulated cell of a dry run; the report holds the results against it.

    Raises
    ------
    BadAnswer
        No calibration is possible.
    """
    recording = read_recording(outcome.folder)
    if not recording.has_detections:
        corners = corners_of_run(recording, result.detections)
        write_corners(outcome.folder / DETECTIONS, corners, recording.board)
    say("calibrating")
    calibrated, folder = calibrate_into(recording, outcome.folder, simulated=simulated)
    calibrates = replace(
        outcome,
        text=f"{outcome.text}\n{calibration_summary(calibrated.mapping)}",
        mapping=outcome.mapping | _files(folder, "calibration.json", "report.html"),
    )
    say("diagnosing; this takes a minute or more")
    try:
        diagnosed = diagnose_into(
            recording, folder, simulated=simulated, calibrated=calibrated, truth=truth
        )
    except BadAnswer as undiagnosed:
        return replace(calibrates, text=f"{calibrates.text}\nnot diagnosed: {undiagnosed}")
    return replace(
        calibrates,
        text=f"{calibrates.text}\n{diagnosis_summary(diagnosed.mapping)}",
        mapping=calibrates.mapping
        | _files(folder, "diagnosis.json", "twin.yaml")
        | {"verdict": diagnosed.mapping["verdict"]},
    )


def _files(folder: Path, *names: str) -> dict[str, str]:
    return {Path(name).stem: str(folder / name) for name in names}


def corners_of_run(recording: Recording, found: dict[int, Detection]) -> Corners:
    """The boards that the run's own checks found; the other frames' pictures are searched."""
    left = tuple(frame for frame in recording.frames if frame.frame not in found)
    rest = detect_corners(replace(recording, frames=left)) if left else Corners({})
    return Corners(
        px={**rest.px, **{n: d.corners_px for n, d in found.items()}},
        sigma_px={**rest.sigma_px, **{n: d.sigma_px for n, d in found.items()}},
        blur_px={**rest.blur_px, **{n: d.frame_blur_px for n, d in found.items()}},
        rejected=rest.rejected,
    )
