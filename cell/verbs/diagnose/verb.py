"""From a recording's folder to `diagnosis.json`, `twin.yaml` and `report.html`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.chain.effect import Present
from calib.chain.effects import catalogue
from calib.chain.model import CellModel
from calib.detection.same_order import same_order_everywhere
from calib.discovery.diagnose import diagnose
from calib.discovery.diagnosis import Diagnosis
from calib.discovery.laws.shape import law_shapes
from calib.errors import CalibrationError
from calib.views import Views
from cell.errors import BadAnswer, InputError
from cell.storage.files.provenance import provenance
from cell.storage.files.results import results_folder, write_results
from cell.storage.recording import Corners, Recording, frames_as_views, read_frames
from cell.storage.recording.detect import Progress, corners_of
from cell.verbs.calibrate import Calibrated, calibrate_recording, report_data
from cell.verbs.diagnose.brightness import brightness_notes
from cell.verbs.diagnose.mapping import as_mapping
from cell.verbs.diagnose.prediction import AFTER, BEFORE, write_prediction
from cell.verbs.diagnose.separate import separations
from cell.verbs.diagnose.twin import twin_text
from cell.views.report import diagnosis_evidence, simulation_truth, write_report

DIAGNOSIS = "diagnosis.json"
TWIN = "twin.yaml"
REPORT = "report.html"


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis, the content of its file, and the folder it stands in."""

    found: Diagnosis
    mapping: dict[str, Any]
    folder: Path


def diagnose_into(
    recording: Recording,
    folder: Path | None = None,
    *,
    predict: Path | None = None,
    effects: Sequence[str] | None = None,
    progress: Progress | None = None,
    simulated: bool = False,
    calibrated: Calibrated | None = None,
    truth: CellModel | None = None,
) -> Diagnosed:
    """`cell diagnose`.

    Parameters
    ----------
    recording:
        Nothing of it is changed.
    folder:
        Where to; a folder `diagnosis` in the recording where None, or here if that is read-only.
    predict:
        A frames.jsonl with robot poses at which to predict the corners.
    effects:
        Names to take in place of the search.
    progress:
        Called after every picture searched.
    simulated:
        Puts the banner on the report.
    calibrated:
        The recording's calibration, where it was made already; it goes into the report.
    truth:
        The simulated cell that made the recording, for the report alone.

    Raises
    ------
    BadAnswer
        The recording cannot be diagnosed; the message says why.
    InputError
        A file is broken, or an effect's name is unknown.
    """
    folder = (
        results_folder(recording.path, recording.name, "diagnosis") if folder is None else folder
    )
    forced = None if effects is None else [named(name) for name in effects]
    corners = corners_of(recording, progress)
    views = same_order_everywhere(recording.views(corners))
    ahead = None if predict is None else frames_as_views(recording, read_frames(predict).frames)
    try:
        found = diagnose(views, log=_together(views, ahead), forced=forced)
    except CalibrationError as error:
        raise BadAnswer(f"{recording.path}: {error}") from None
    plans = separations(found, recording)
    notes = brightness_notes(recording, found)
    origin = provenance(recording.header.as_mapping())
    mapping = as_mapping(found, recording.name, plans, notes, origin)
    write_results(folder, {DIAGNOSIS: json.dumps(mapping, indent=1) + "\n"})
    write_results(folder, {TWIN: twin_text(found, recording)})
    write_results(folder, {plan.file: plan.text for plan in plans if plan.file is not None})
    if ahead is not None:
        rows = np.isin(found.log.frame, ahead.frame)
        write_prediction(folder / BEFORE, found.plain.model, found.log.take(rows))
        write_prediction(folder / AFTER, found.twin.model, found.log.take(rows))
    _report(recording, folder, corners, found, mapping, simulated, calibrated, truth)
    return Diagnosed(found, mapping, folder)


def named(name: str) -> Present:
    """Return the effect of that name (`name` or `name:law`), with amounts still zero.

    Raises
    ------
    InputError
        For a name that the catalogue does not have.
    """
    matching = [e for e in catalogue() if name in (e.name, e.label)]
    if not matching:
        known = ", ".join(sorted({e.name for e in catalogue()}))
        raise InputError(f"--effects: no effect is called {name!r}; known are {known}")
    effect = next((e for e in matching if e.law in (None, "inverse_square")), matching[0])
    return Present(effect, effect.values({}))


def _together(views: Views, ahead: Views | None) -> Views:
    """Every known row of the log in the order of frames."""
    if ahead is None:
        return views
    return views.joined(ahead.take(~np.isin(ahead.frame, views.frame)))


def _report(
    recording: Recording,
    folder: Path,
    corners: Corners,
    found: Diagnosis,
    mapping: dict[str, Any],
    simulated: bool,
    calibrated: Calibrated | None,
    truth: CellModel | None,
) -> None:
    if calibrated is None:
        mixed_up = any(effect.link == "bookkeeping" for effect in found.effects)
        mended = found.views if mixed_up else None
        calibrated = calibrate_recording(recording, corners, mended=mended)
    data = report_data(recording, calibrated, simulated=simulated)
    noise = found.twin.noise
    evidence = diagnosis_evidence(
        data.views,
        found.views,
        found.plain.model,
        found.twin.model,
        corner_px=noise.corner_px,
        flange_m=noise.flange_m,
    )
    evidence = replace(evidence, laws=law_shapes(found.twin, found.views))
    known = None if truth is None else simulation_truth(truth, data.views)
    data = replace(data, diagnosis=mapping, evidence=evidence, truth=known)
    write_report(folder / REPORT, data)
