"""`cell calibrate`: from a recording to `calibration.json` and the arrays a report needs."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calib.calibration import Calibration, calibrate
from calib.calibration.mapping import as_mapping
from calib.detection.same_order import same_order_everywhere
from calib.errors import CalibrationError
from calib.views import Views
from cell.errors import BadAnswer
from cell.storage.files.calibration_file import CalibrationFile
from cell.storage.files.provenance import provenance
from cell.storage.files.results import results_folder, write_results
from cell.storage.recording import Corners, Recording, write_corners
from cell.storage.recording.detect import Progress, corners_of
from cell.verbs.log_warnings import log_mixups, mixup_warnings
from cell.views.report import (
    ReportData,
    recording_data,
    solution_poses,
    solution_residuals,
    write_report,
)
from cell.views.report.answer_values import work_out

FILE_NAME = "calibration.json"


@dataclass(frozen=True)
class Calibrated:
    """What `calibrate_recording` found.

    Attributes
    ----------
    views:
        All frames of the recording.
    result:
        The calibration.
    mapping:
        The content of `calibration.json`.
    """

    views: Views
    result: Calibration
    mapping: dict[str, Any]


def calibrate_recording(
    recording: Recording,
    corners: Corners | None = None,
    progress: Progress | None = None,
    *,
    mended: Views | None = None,
) -> Calibrated:
    """Calibrate a recording in every way it allows.

    Parameters
    ----------
    recording, corners:
        What was recorded, and the corners in its pictures where they are known already.
    progress:
        Called after every picture searched.
    mended:
        The recording's frames with the log put right, to be calibrated in place of the log as
        it stands.

    Raises
    ------
    BadAnswer
        No calibration is possible; the message says why and how to mend it.
    InputError
        The recording's files are broken.
    """
    corners = corners_of(recording, progress) if corners is None else corners
    views = same_order_everywhere(recording.views(corners)) if mended is None else mended
    try:
        result = calibrate(views)
    except CalibrationError as error:
        raise BadAnswer(f"{recording.path}: {error}{_first_reasons(corners)}") from None
    mixups = log_mixups(views, result)
    stale = next((mixup for mixup in mixups if mixup.name == "stale_poses"), None)
    if stale is not None:
        # rows that repeat another's are no poses of their own; the rest of the log may well do
        views = stale.mend(views, views)
        result = calibrate(views)
    mapping = as_mapping(result, recording.name)
    origin = provenance(recording.header.as_mapping())
    mapping |= origin | {"robot": origin["robot"] | mapping["robot"]}
    mapping["warnings"] = mixup_warnings(mixups) + mapping["warnings"]
    for rejection in mapping["frames_rejected"]:
        rejection["reason"] = corners.rejected.get(rejection["frame"], rejection["reason"])
    calibrated = Calibrated(views, result, mapping)
    mapping["answer"] = work_out(report_data(recording, calibrated))
    checked = CalibrationFile.model_validate(mapping)
    return replace(calibrated, mapping=checked.model_dump(mode="json", by_alias=True))


def _first_reasons(corners: Corners) -> str:
    """The three first rejected frames with their reasons, to put behind an error."""
    reported = [f"\n  frame {frame}: {why}" for frame, why in list(corners.rejected.items())[:3]]
    more = len(corners.rejected) - len(reported)
    return "".join(reported) + (f"\n  and {more} frames more" if more > 0 else "")


def default_folder(recording: Recording) -> Path:
    """Where results go without `-o`."""
    return results_folder(recording.path, recording.name, "calibration")


def calibrate_into(
    recording: Recording,
    folder: Path | None = None,
    *,
    progress: Progress | None = None,
    simulated: bool = False,
) -> tuple[Calibrated, Path]:
    """`cell calibrate`: calibrate a recording and write `calibration.json` and `report.html`.

    Parameters
    ----------
    recording:
        Nothing of it is changed.
    folder:
        Where to; `default_folder` where None.
    progress:
        Called after every picture searched.
    simulated:
        Puts the banner on the report.

    Returns
    -------
    The calibration and the folder it stands in.

    Raises
    ------
    BadAnswer, InputError
        As `calibrate_recording` and `write_calibration` do.
    """
    folder = default_folder(recording) if folder is None else folder
    corners = corners_of(recording, progress)
    calibrated = calibrate_recording(recording, corners)
    write_calibration(calibrated, folder, None if recording.has_detections else corners)
    write_report(folder / "report.html", report_data(recording, calibrated, simulated=simulated))
    return calibrated, folder


def report_data(
    recording: Recording, calibrated: Calibrated, *, simulated: bool = False
) -> ReportData:
    """What the report shows of a calibration alone."""
    data = recording_data(recording, calibrated.views)
    return replace(
        data,
        calibration=calibrated.mapping,
        residuals_px=solution_residuals(calibrated.result),
        poses=solution_poses(calibrated.result, calibrated.views),
        simulated=simulated or data.simulated,
    )


def write_calibration(calibrated: Calibrated, folder: Path, corners: Corners | None = None) -> Path:
    """Write `calibration.json`, and `detections.csv` of corners that were found anew.

    Results may be made again, so older ones of the same name are replaced, each whole.

    Raises
    ------
    InputError
        The folder cannot be written.
    """
    write_results(folder, {FILE_NAME: json.dumps(calibrated.mapping, indent=1) + "\n"})
    if corners is not None:
        write_corners(folder / "detections.csv", corners, calibrated.views.board)
    return folder / FILE_NAME
