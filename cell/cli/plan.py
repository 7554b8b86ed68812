"""`cell plan`: design the poses for a cell."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from cell.cli.output import JsonFlag, show
from cell.errors import InputError


def plan(
    cell: Annotated[Path, typer.Argument(help="A cell file.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The plan file to write.")
    ] = None,
    parallel: Annotated[int, typer.Option(min=0, help="Fronto-parallel views.")] = 16,
    varied: Annotated[int, typer.Option(min=0, help="Tilted views.")] = 24,
    seed: Annotated[int, typer.Option(min=0, help="Of the spread of the tilted views.")] = 1,
    by_hand: Annotated[
        bool, typer.Option("--by-hand", help="Near views tilted, far ones flat: the paper's plan.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Design a plan whose poses the arm can reach, with the board whole in the picture."""
    from cell.files.cell_file import read_cell
    from cell.files.writing import yaml_text
    from cell.planning import PlanSize, design_plan

    path = output or cell.with_name(cell.name.split(".")[0] + ".plan.yaml")
    if path.exists():
        raise InputError(f"{path}: is there already and is not overwritten; give another -o")
    beside = os.path.relpath(cell.resolve(), path.resolve().parent)
    designed = design_plan(read_cell(cell), PlanSize(parallel, varied, seed, by_hand), beside)
    size = f"--parallel {parallel} --varied {varied} --seed {seed}"
    size += " --by-hand" if by_hand else ""
    comment = f"Made by `cell plan {cell.name} {size}`."
    try:
        path.write_text(yaml_text(designed.as_mapping(), comment=comment), encoding="utf-8")
    except OSError as fault:
        raise InputError(f"{path}: cannot be written: {fault.strerror}") from None
    stations = [view.station for view in designed.views]
    counts = {kind: stations.count(kind) for kind in ("parallel", "varied")}
    result = {"plan": str(path), "views": len(stations), **counts}
    show(
        f"{path}: {counts['parallel']} parallel and {counts['varied']} tilted views",
        result,
        as_json=as_json,
    )
