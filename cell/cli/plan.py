"""`cell plan`: design the poses for a cell."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cell.cli.output import JsonFlag, show

if TYPE_CHECKING:
    from cell.files.plan_file import PlanFile
    from cell.planning import PlanSize


def plan(
    cell: Annotated[Path, typer.Argument(help="A cell file; with --power a plan file too.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The plan file to write.")
    ] = None,
    parallel: Annotated[int, typer.Option(min=0, help="Fronto-parallel views.")] = 16,
    varied: Annotated[int, typer.Option(min=0, help="Tilted views.")] = 24,
    seed: Annotated[int, typer.Option(min=0, help="Of the spread of the tilted views.")] = 1,
    by_hand: Annotated[
        bool, typer.Option("--by-hand", help="Near views tilted, far ones flat: the paper's plan.")
    ] = False,
    power: Annotated[
        bool,
        typer.Option(
            "--power",
            help="Say which effects the plan would reveal, and at what size; a plan is written"
            " only where -o is given.",
        ),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Design a plan whose poses the arm can reach, with the board whole in the picture."""
    from cell.planning import PlanSize

    size = PlanSize(parallel, varied, seed, by_hand)
    if power:
        _power(cell, output, size, as_json=as_json)
        return
    path = output or cell.with_name(cell.name.split(".")[0] + ".plan.yaml")
    designed = _designed(cell, path, size)
    stations = [view.station for view in designed.views]
    counts = {kind: stations.count(kind) for kind in ("parallel", "varied")}
    result = {"plan": str(path), "views": len(stations), **counts}
    show(
        f"{path}: {counts['parallel']} parallel and {counts['varied']} tilted views",
        result,
        as_json=as_json,
    )


def _designed(cell: Path, path: Path, size: PlanSize) -> PlanFile:
    """Design a plan and write it."""
    from cell.files.cell_file import read_cell
    from cell.files.writing import check_new, write_new, yaml_text
    from cell.planning import design_plan

    check_new(path)
    beside = os.path.relpath(cell.resolve(), path.resolve().parent)
    designed = design_plan(read_cell(cell), size, beside)
    told = f"--parallel {size.parallel} --varied {size.varied} --seed {size.seed}"
    told += " --by-hand" if size.by_hand else ""
    comment = f"Made by `cell plan {cell.name} {told}`."
    write_new(path, yaml_text(designed.as_mapping(), comment=comment))
    return designed


def _power(given: Path, output: Path | None, size: PlanSize, *, as_json: bool) -> None:
    from rich.console import Console

    from cell.files.cell_file import read_cell
    from cell.planning import design_plan
    from cell.planning.power import as_mapping, as_text, is_plan, power_of_design, power_of_file

    if is_plan(given):
        found = power_of_file(given)
    else:
        cell = read_cell(given)
        designed = design_plan(cell, size) if output is None else _designed(given, output, size)
        found = power_of_design(designed, cell, output or given)
    if as_json:
        show("", as_mapping(found), as_json=True)
    else:
        Console(highlight=False).print(as_text(found))
