"""`cell verify`: a recording, or a short run of a plan, held against an old calibration."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

from calib.detection.same_order import same_order_everywhere
from cell.errors import InputError
from cell.storage.files.calibration_place import calibration_file
from cell.storage.files.calibration_source import read_calibration
from cell.storage.files.provenance import provenance
from cell.storage.files.results import write_results
from cell.storage.files.verify_file import VerifyFile
from cell.storage.recording import Recording
from cell.storage.recording.detect import Progress, corners_of
from cell.verbs.verify.check import check
from cell.verbs.verify.length import KnownLength
from cell.verbs.verify.old_cell import OldCell, old_cell
from cell.verbs.verify.page import render

FILE_NAME = "verify.json"
PAGE_NAME = "verify.html"


@dataclass(frozen=True)
class Verified:
    """A check, and the files it wrote."""

    content: VerifyFile
    file: Path
    page: Path


def read_old(path: Path) -> tuple[OldCell, Path]:
    """The calibration that `path` means, and its file; raises `InputError`."""
    file = calibration_file(path)
    source = read_calibration(file)
    try:
        return old_cell(source), file
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def verify_into(
    recording: Recording,
    calibration: Path,
    folder: Path,
    *,
    known: KnownLength | None = None,
    tolerance_m: float | None = None,
    progress: Progress | None = None,
) -> Verified:
    """Check a calibration with a recording; writes `verify.json` and `verify.html`.

    Parameters
    ----------
    recording, calibration:
        Nothing of them is changed.
    folder:
        Where to; earlier results of the same name are replaced.
    known:
        A length measured by other means.
    tolerance_m:
        Error at the work piece that matters; see `check`.
    progress:
        Called after every picture searched.

    Raises
    ------
    InputError
        Calibration or recording is of no use here, or the folder cannot be written.
    """
    old, file = read_old(calibration)
    corners = corners_of(recording, progress)
    checked = check(
        old,
        same_order_everywhere(recording.views(corners)),
        calibration=str(file),
        recording=recording.name,
        known=known,
        tolerance_m=tolerance_m,
        left_out=dict(corners.rejected),
    )
    origin = VerifyFile.model_validate(
        checked.content.model_dump(by_alias=True) | provenance(recording.header.as_mapping())
    )
    checked = replace(checked, content=origin)
    page = render(checked, simulated=recording.header.simulated)
    content = json.dumps(checked.content.model_dump(mode="json", by_alias=True), indent=1) + "\n"
    write_results(folder, {FILE_NAME: content, PAGE_NAME: page})
    return Verified(checked.content, folder / FILE_NAME, folder / PAGE_NAME)
