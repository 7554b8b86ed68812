"""`cell compare`: where two calibrations differ, and whether by more than chance."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.views.terminal.output import say, show


def compare(
    a: Annotated[Path, typer.Argument(help="A calibration.json, its folder, or a recording.")],
    b: Annotated[Path, typer.Argument(help="The other one.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="HTML file with maps over the image.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Compare two calibrations or recordings of one camera, in pixels and millimetres."""
    from cell.verbs.compare import compare as compare_sides
    from cell.verbs.compare import side_of
    from cell.verbs.compare.messages import as_mapping, text
    from cell.verbs.compare.page import write_page
    from cell.verbs.compare.sources import source_of

    comparison = compare_sides(side_of(source_of(a), str(a)), side_of(source_of(b), str(b)))
    if output is not None:
        write_page(output, comparison)
        say(f"page: {output}")
    show(text(comparison), as_mapping(comparison), as_json=as_json)
