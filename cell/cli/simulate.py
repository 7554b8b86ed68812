"""`cell simulate`: a synthetic recording of a plan."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.storage.files.results import new_folder
from cell.views.terminal.output import show


def simulate(
    plan: Annotated[Path, typer.Argument(help="A plan, or the twin.yaml of a diagnosis.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder of the recording.")
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option("--effect", help="NAME:key=value,... in place of the cell's own effects."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Of all noise, in place of the cell's own.")
    ] = None,
    images: Annotated[
        bool, typer.Option("--images", help="Render pictures too, through the whole run.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Make the recording that a simulated cell would give, with the named effects in it."""
    from cell.storage.files.plan_file import read_plan
    from cell.verbs.simulate import simulate_corners, simulate_pictures, with_effects

    read = read_plan(plan)
    folder = output or new_folder(f"{read.file.name}-simulated")
    changed = with_effects(read, tuple(effect or ()))
    make = simulate_pictures if images else simulate_corners
    frames = make(changed, folder, seed)
    truth = changed.cell.simulation
    names = [present.name for present in truth.effects] if truth else []
    result = {"recording": str(folder), "frames": frames, "effects": names}
    text = f"{folder}: {frames} frames with {', '.join(names) or 'no effects'}"
    show(text, result, as_json=as_json)
