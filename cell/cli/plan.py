"""`cell plan`: design the poses for a cell."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.views.terminal.output import say, show

if TYPE_CHECKING:
    from cell.storage.files.plan_file import Plan
    from cell.verbs.plan import PlanSize, Requirements


def plan(
    cell: Annotated[Path, typer.Argument(help="A cell file; with --power a plan file too.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The plan file to write.")
    ] = None,
    frames: Annotated[
        int | None, typer.Option(min=1, help="Views in all, a quarter of them parallel; 40.")
    ] = None,
    parallel: Annotated[
        int | None, typer.Option(min=0, help="Fronto-parallel views among them.")
    ] = None,
    varied: Annotated[int | None, typer.Option(min=0, help="Tilted views among them.")] = None,
    alpha_sigma_px: Annotated[
        float | None,
        typer.Option(
            min=1e-6, help="Take the fewest views that promise alpha so well at every distance."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the spread of the candidates.")] = 1,
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
    """Design a plan: the views that make the calibration most certain, and the way between them."""
    from cell.verbs.plan import Requirements

    requirements = Requirements(frames, parallel, varied, alpha_sigma_px, seed, by_hand)
    if power:
        _power(cell, output, requirements, as_json=as_json)
        return
    path = output or cell.with_name(cell.name.split(".")[0] + ".plan.yaml")
    designed, size = _written(cell, path, requirements)
    _print_plan(designed, size, as_json=as_json)


def _designed(cell: Path, path: Path, requirements: Requirements) -> tuple[Plan, PlanSize]:
    from cell.storage.files.cell_file import read_cell
    from cell.storage.files.plan_file import Plan
    from cell.verbs.plan import design_plan

    read = read_cell(cell)
    held = cell.resolve().is_relative_to(path.resolve().parent)  # a plan names no file elsewhere
    named = os.path.relpath(cell.resolve(), path.resolve().parent) if held else None
    size = requirements.size_for(read)
    return Plan(path, design_plan(read, size, named), read), size


def _written(cell: Path, path: Path, requirements: Requirements) -> tuple[Plan, PlanSize]:
    """Design a plan and write it."""
    from cell.storage.files.writing import check_new, write_new, yaml_text

    check_new(path)
    plan, size = _designed(cell, path, requirements)
    comment = f"Made by `cell plan {' '.join([cell.name, *requirements.as_options()])}`."
    write_new(path, yaml_text(plan.file.as_mapping(), comment=comment))
    return plan, size


def _print_plan(plan: Plan, size: PlanSize, *, as_json: bool) -> None:
    from cell.verbs.plan import clearance, expected_uncertainty, power
    from cell.verbs.plan.shortfall import shortfalls

    stations = [view.station for view in plan.file.views]
    counts = {kind: stations.count(kind) for kind in ("parallel", "varied")}
    near = clearance.of_plan(plan)
    short = shortfalls(plan, size)
    for line in short:
        say(f"warning: {line}")
    promised, seen = expected_uncertainty.expected_from(plan), power.power_of(plan)
    result = {
        "plan": str(plan.path),
        "views": len(stations),
        **counts,
        "warnings": short,
        "clearance": clearance.as_mapping(near),
        "expected": expected_uncertainty.as_mapping(promised),
        "effects": power.as_shares(seen),
    }
    head = f"{plan.path}: {counts['parallel']} parallel and {counts['varied']} tilted views"
    lines = [
        head,
        clearance.as_line(near),
        *expected_uncertainty.as_lines(promised),
        *power.as_lines(seen),
    ]
    show("\n".join(lines), result, as_json=as_json)


def _power(given: Path, output: Path | None, requirements: Requirements, *, as_json: bool) -> None:
    from rich.console import Console

    from cell.verbs.plan.power import as_mapping, as_text, is_plan, power_of, power_of_file

    if is_plan(given):
        found = power_of_file(given)
    elif output is None:
        found = power_of(_designed(given, given, requirements)[0])
    else:
        found = power_of(_written(given, output, requirements)[0])
    if as_json:
        show("", as_mapping(found), as_json=True)
    else:
        Console(highlight=False).print(as_text(found))
