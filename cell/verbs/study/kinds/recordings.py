"""Many recordings: each is calibrated or diagnosed, and nothing of it is changed."""

from __future__ import annotations

import glob
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
from rich.table import Table

from calib.detection.same_order import same_order_everywhere
from calib.discovery.diagnose import diagnose
from calib.errors import CalibrationError
from cell.errors import BadAnswer, InputError
from cell.storage.files.study_file import Study
from cell.storage.incoming import inside
from cell.storage.recording import Recording, read_recording
from cell.storage.recording.detect import corners_of
from cell.storage.recording.header import FILE_NAME
from cell.verbs.calibrate import calibrate_recording
from cell.verbs.diagnose.brightness import brightness_notes
from cell.verbs.diagnose.mapping import as_mapping
from cell.verbs.diagnose.separate import separations
from cell.verbs.study.kinds.kind import Kind, Row, Task, grouped


@dataclass(frozen=True)
class Job(Task):
    """One verb on one recording."""

    recording: str
    verb: str

    def asked(self) -> Row:
        """Recording and verb."""
        return {"recording": self.recording, "verb": self.verb}


COLUMNS = (
    pa.field("recording", pa.string()),
    pa.field("verb", pa.string()),
    pa.field("frames_used", pa.int32()),
    pa.field("frames_rejected", pa.int32()),
    pa.field("verdict", pa.string()),
    pa.field("named", pa.list_(pa.string())),
    pa.field("solution", pa.string()),
    pa.field("rms_px", pa.float64()),
    pa.field("document", pa.string()),
)

_BEST = ("joint_ml", "zhang_mle")


def _tasks(study: Study) -> list[Job]:
    asked = study.file.recordings
    assert asked is not None
    found = [folder for pattern in asked.folders for folder in _folders(study.path, pattern)]
    jobs = [(verb, str(folder)) for folder in dict.fromkeys(found) for verb in asked.verbs]
    return [
        Job(number, f"{verb} {folder}", folder, verb) for number, (verb, folder) in enumerate(jobs)
    ]


def _folders(study: Path, pattern: str) -> list[Path]:
    """The recordings a pattern means, below the study's folder; raises `InputError`."""
    where = f"{study}: recordings.folders"
    inside(study.parent, pattern, where)
    matches = [Path(match) for match in sorted(glob.glob(str(study.parent / pattern)))]
    if not matches:
        raise InputError(
            f"{study}: recordings.folders: nothing is at {study.parent / pattern}; the path counts"
            " from the study's folder"
        )
    held = [inside(study.parent, str(m.relative_to(study.parent)), where) for m in matches]
    folders = [match.resolve() for match in held if (match / FILE_NAME).is_file()]
    if not folders:
        raise InputError(
            f"{study}: recordings.folders: nothing that {pattern} means is a recording, a folder"
            f" with {FILE_NAME}"
        )
    return folders


def _work(study: Study, job: Job) -> Row:
    recording = read_recording(job.recording)
    verb = _calibrated if job.verb == "calibrate" else _diagnosed
    return verb(recording)


def _calibrated(recording: Recording) -> Row:
    mapping = calibrate_recording(recording).mapping
    best = next(name for name in _BEST if name in mapping["solutions"])
    return {
        "frames_used": len(mapping["frames_used"]),
        "frames_rejected": len(mapping["frames_rejected"]),
        "solution": best,
        "rms_px": mapping["solutions"][best]["reprojection_px"]["rms"],
        "document": json.dumps(mapping),
    }


def _diagnosed(recording: Recording) -> Row:
    views = same_order_everywhere(recording.views(corners_of(recording)))
    try:
        found = diagnose(views)
    except CalibrationError as error:
        raise BadAnswer(f"{recording.path}: {error}") from None
    # plans are files beside a diagnosis.json, and here is none: `cell diagnose` writes them
    plans = [replace(plan, file=None) for plan in separations(found, recording)]
    mapping = as_mapping(found, recording.name, plans, brightness_notes(recording, found))
    return {
        "frames_used": len(mapping["frames_used"]),
        "frames_rejected": len(mapping["frames_rejected"]),
        "verdict": mapping["verdict"],
        "named": [effect["name"] for effect in mapping["effects"]],
        "rms_px": mapping["holdout"]["rms_px_after"] if mapping["holdout"] else None,
        "document": json.dumps(mapping),
    }


def _summary(rows: Sequence[Row]) -> Mapping[str, Any]:
    reported = [
        {name: value for name, value in row.items() if name not in ("document", "worker", "key")}
        for row in rows
    ]
    verdicts = {
        verdict: len(own) for verdict, own in grouped(rows, "verdict") if verdict is not None
    }
    return {"recordings": reported, "verdicts": verdicts}


def _tables(summary: Mapping[str, Any]) -> Sequence[Table]:
    table = Table()
    table.add_column("recording")
    table.add_column("verb", no_wrap=True)
    for title in ("frames", "rejected", "rms px"):
        table.add_column(title, justify="right")
    table.add_column("says")
    for row in summary["recordings"]:
        rms = row["rms_px"]
        table.add_row(
            Path(row["recording"]).name,
            row["verb"],
            str(row["frames_used"]),
            str(row["frames_rejected"]),
            "-" if rms is None else f"{rms:.3f}",
            row["solution"] or ": ".join([row["verdict"], ", ".join(row["named"]) or "nothing"]),
        )
    return [table]


KIND = Kind(COLUMNS, _tasks, _work, _summary, _tables)
