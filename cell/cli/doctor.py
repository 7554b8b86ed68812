"""`cell doctor`: what is installed, reachable and ready, and how to mend what is not."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.errors import EXIT_DEVICE
from cell.views.terminal.output import show


def doctor(
    cell: Annotated[Path | None, typer.Argument(help="A cell file; its devices are asked.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Look what stands in the way of a run; nothing is moved or changed."""
    from cell.storage.files.cell_file import read_cell
    from cell.verbs.doctor import examine

    findings = examine(None if cell is None else read_cell(cell))
    blocking = [finding.name for finding in findings if finding.blocks]
    verdict = f"in the way: {', '.join(blocking)}" if blocking else "ready"
    show(
        "\n".join([*(finding.line() for finding in findings), verdict]),
        {"ready": not blocking, "findings": [vars(finding) for finding in findings]},
        as_json=as_json,
    )
    if blocking:
        raise typer.Exit(EXIT_DEVICE)
