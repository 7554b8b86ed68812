"""`cell calibrate`: from a recording to a calibration and its report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.errors import BadAnswer
from cell.views.terminal.output import say, show


def calibrate(
    recording: Annotated[Path, typer.Argument(help="A recording's folder.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for the results.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Calibrate a recording; writes calibration.json and report.html."""
    from cell.storage.recording import read_recording
    from cell.verbs.calibrate import calibrate_into
    from cell.views.terminal.progress import counted_progress
    from cell.views.terminal.summary import (
        calibration_summary,
        undetermined_text,
        warning_lines,
    )

    source = read_recording(recording)
    with counted_progress("finding corners") as progress:
        calibrated, folder = calibrate_into(
            source, output, progress=progress, simulated=source.header.simulated
        )
    for line in warning_lines(calibrated.mapping):
        say(line)
    text = f"{calibration_summary(calibrated.mapping)}\nreport: {folder / 'report.html'}"
    show(text, calibrated.mapping, as_json=as_json)
    missing = undetermined_text(calibrated.mapping)
    if missing is not None:
        raise BadAnswer(f"{recording}: {missing}")
