"""`cell diagnose`: compare the simulation with a recording, and name what is missing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.views.terminal.output import show


def diagnose(
    recording: Annotated[Path, typer.Argument(help="A recording's folder.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for the results.")
    ] = None,
    predict: Annotated[
        Path | None, typer.Option(help="A frames.jsonl at whose robot poses to predict corners.")
    ] = None,
    effects: Annotated[
        str | None, typer.Option(help="NAME,... to take in place of the search.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Diagnose a recording; writes diagnosis.json, twin.yaml and report.html."""
    from cell.storage.recording import read_recording
    from cell.verbs.diagnose import diagnose_into
    from cell.views.terminal.progress import counted_progress
    from cell.views.terminal.summary import diagnosis_summary

    source = read_recording(recording)
    names = None if effects is None else [name for name in effects.split(",") if name]
    with counted_progress("finding corners") as progress:
        diagnosed = diagnose_into(
            source,
            output,
            predict=predict,
            effects=names,
            progress=progress,
            simulated=source.header.simulated,
        )
    text = f"{diagnosis_summary(diagnosed.mapping)}\nreport: {diagnosed.folder / 'report.html'}"
    show(text, diagnosed.mapping, as_json=as_json)
