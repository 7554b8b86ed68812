"""A whole run: record a plan, calibrate and diagnose what was recorded, write the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.chain.model import CellModel
from calib.detection import Detection
from cell.devices.factory import peer_devices, real_devices, simulated_devices
from cell.devices.simulated_cell import home_of, simulated_cell
from cell.errors import BadAnswer
from cell.sequencer.sequencer import Devices
from cell.sequencer.session import record_plan
from cell.sequencer.states import Finish, RunResult
from cell.sequencer.watcher import Watcher
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.recording import Corners, Recording, read_recording, write_corners
from cell.storage.recording.corners import FILE_NAME as DETECTIONS
from cell.storage.recording.detect import detect_corners
from cell.verbs.calibrate import calibrate_into
from cell.verbs.diagnose import diagnose_into
from cell.views.running_estimate.early_end import EarlyEnd
from cell.views.running_estimate.process import RunningEstimate
from cell.views.terminal.output import say
from cell.views.terminal.progress import run_progress
from cell.views.terminal.summary import (
    answer_line,
    calibration_summary,
    diagnosis_summary,
    undetermined_text,
    warning_lines,
)

if TYPE_CHECKING:
    from cell.views.page.live_run import LiveRun


@contextmanager
def shown_on_page(
    address: str | None, plan: Plan, folder: Path, *, dry_run: bool
) -> Iterator[LiveRun | None]:
    """Serve the live page while the context holds; None where no address is given.

    Raises
    ------
    InputError
        The address cannot be had.
    """
    if address is None:
        yield None
        return
    from cell.views.page.address import Address
    from cell.views.page.live_run import LiveRun
    from cell.views.page.server import LivePage

    live = LiveRun(plan, simulated=dry_run, folder=str(folder))
    with LivePage(live, Address.parse(address)) as url:
        say(f"live page: {url}")
        try:
            yield live
        except BaseException as fault:
            live.ended(str(fault) or type(fault).__name__, {})
            raise


def record(
    plan: Plan,
    folder: Path,
    *,
    dry_run: bool,
    resume: bool,
    peers: bool = False,
    live: LiveRun | None = None,
) -> RunResult:
    """Run a plan into a recording, with its progress in the terminal.

    Parameters
    ----------
    dry_run, peers:
        Simulated devices; in this process, or behind the real drivers and their protocols.
    live:
        The run on the live page, which may stop it; None without one.

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
        if goal is not None or live is not None:
            estimate = RunningEstimate(plan, folder if resume else None, goal)
            watchers.append(stack.enter_context(estimate))
        if live is not None:
            estimate.on_estimate(live.estimated)
            watchers.append(live)
        result = record_plan(
            plan,
            folder,
            devices,
            simulated=dry_run,
            resume=resume,
            stop=live.stop if live else None,
            requests=live.requests if live else None,
            watchers=watchers,
            goal=goal,
        )
    if live is not None:
        live.recorded(result)
    return result


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
    undetermined:
        What of the calibration the frames do not determine, as text.
    """

    folder: Path
    complete: bool
    text: str
    mapping: dict[str, Any]
    undetermined: str | None = None

    @property
    def files(self) -> dict[str, str]:
        """What was written, by what it is."""
        written = ("recording", "calibration", "diagnosis", "report")
        return {name: self.mapping[name] for name in written if name in self.mapping}

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
        text = f"{result.finish.text}: {result.frames} frames{lost} in {folder}"
        if result.ended_early:
            text = f"{text}\nended early: {result.ended_early}"
        complete = result.finish in (Finish.COMPLETED, Finish.COMPLETED_WITH_LOSSES)
        return cls(folder, complete, text, mapping)


def evaluate(
    outcome: Outcome,
    result: RunResult,
    *,
    simulated: bool,
    truth: CellModel | None = None,
    report_progress: Callable[[str], None] = say,
) -> Outcome:
    """Calibrate and diagnose a finished run; the results go into the recording's folder.

    `truth` is the simulated cell of a dry run; the report holds the results against it.
    `report_progress` hears what is being done.

    Raises
    ------
    BadAnswer
        No calibration is possible.
    """
    recording = read_recording(outcome.folder)
    if not recording.has_detections:
        corners = corners_of_run(recording, result.detections)
        write_corners(outcome.folder / DETECTIONS, corners, recording.board)
    report_progress("calibrating")
    calibrated, folder = calibrate_into(recording, outcome.folder, simulated=simulated)
    for line in warning_lines(calibrated.mapping):
        report_progress(line)
    calibrates = replace(
        outcome,
        undetermined=undetermined_text(calibrated.mapping),
        text=f"{outcome.text}\n{calibration_summary(calibrated.mapping)}",
        mapping=outcome.mapping
        | _files(folder, "calibration.json", "report.html")
        | {name: calibrated.mapping[name] for name in ("answer", "warnings", "undetermined")},
    )
    report_progress("diagnosing; this takes a minute or more")
    try:
        diagnosed = diagnose_into(
            recording, folder, simulated=simulated, calibrated=calibrated, truth=truth
        )
    except BadAnswer as undiagnosed:
        return replace(calibrates, text=f"{calibrates.text}\nnot diagnosed: {undiagnosed}")
    return replace(
        calibrates,
        text="\n".join(
            (
                outcome.text,
                calibration_summary(calibrated.mapping, answer=False),
                diagnosis_summary(diagnosed.mapping),
                answer_line(calibrated.mapping),
            )
        ),
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
