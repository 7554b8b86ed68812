"""`cell plan --power`: what a plan would reveal, before anything is recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.table import Table

from calib.discovery.design.power import EffectPower, Power, alike, plan_power
from calib.solver.noise import Noise
from cell.errors import InputError
from cell.files.cell_file import CellFile, Simulation
from cell.files.plan_file import SCHEMA as PLAN_SCHEMA
from cell.files.plan_file import Plan, PlanFile, read_plan
from cell.files.yaml_model import read_mapping
from cell.planning.candidates import Sight
from cell.simulated import home_of, log_of, simulated_cell

USUAL_NOISE = Noise(corner_px=0.1, flange_m=3e-5, flange_rad=1e-4)
"""A good detector and an arm of this class; taken where the cell file does not tell."""


@dataclass(frozen=True)
class PlanPower:
    """A plan's power, and where its noise levels are from."""

    power: Power
    noise_from: str


def is_plan(path: Path) -> bool:
    """Whether the file is a plan (and not a cell)."""
    return str(read_mapping(path).get("schema", "")) == PLAN_SCHEMA


def power_of_file(path: Path) -> PlanPower:
    """Power of a plan file; raises `InputError`."""
    return power_of(read_plan(path))


def power_of_design(designed: PlanFile, cell: CellFile, path: Path) -> PlanPower:
    """Power of a plan that has just been designed for a cell."""
    return power_of(Plan(path, designed, cell))


def power_of(plan: Plan) -> PlanPower:
    """Say what a plan would reveal of the plain cell.

    Raises
    ------
    InputError
        The cell tells neither `simulation` nor `layout`, or a view cannot be reached.
    """
    cell = _nominal(plan.cell)
    plan = Plan(plan.path, plan.file, cell)
    simulated = simulated_cell(cell, home_of(plan))
    noise, noise_from = _noise(plan.cell)
    log = log_of(plan, simulated)
    return PlanPower(plan_power(simulated.model.with_effects(()), log, noise), noise_from)


def _nominal(cell: CellFile) -> CellFile:
    """The cell with a `simulation` section: its own, or what its layout says."""
    if cell.simulation is not None:
        return cell
    if cell.layout is None:
        raise InputError(
            f"cell {cell.name}: says neither `layout` nor `simulation`, so nobody knows what the"
            " camera sees; measure the layout with a tape"
        )
    alpha = Sight.of(cell).alpha_px
    u0, v0 = 0.5 * (cell.camera.width - 1), 0.5 * (cell.camera.height - 1)
    optics = {"alpha_px": alpha, "beta_px": alpha, "u0_px": u0, "v0_px": v0}
    truth = Simulation(mounted=cell.layout.mounted, fixed=cell.layout.fixed, optics=optics)
    return cell.model_copy(update={"simulation": truth})


def _noise(cell: CellFile) -> tuple[Noise, str]:
    told = cell.simulation.noise if cell.simulation else None
    if told is None:
        return USUAL_NOISE, "assumed; the cell file does not tell"
    noise = Noise(
        corner_px=told.corner_px or USUAL_NOISE.corner_px,
        flange_m=told.arm_position_m or USUAL_NOISE.flange_m,
        flange_rad=told.arm_rotation_rad or USUAL_NOISE.flange_rad,
    )
    levels = (told.corner_px, told.arm_position_m, told.arm_rotation_rad)
    return noise, "simulation.noise" if all(levels) else "simulation.noise, zeros as usual"


def as_mapping(found: PlanPower) -> dict[str, Any]:
    """For `--json`."""
    power = found.power
    return {
        "frames": power.frames,
        "noise": {
            "corner_px": power.noise.corner_px,
            "flange_m": power.noise.flange_m,
            "flange_rad": power.noise.flange_rad,
            "from": found.noise_from,
        },
        "effects": [_effect(e) for e in power.effects],
        "unseen": power.unseen,
        "not_told_apart": [
            {
                "names": [first.effect.label, rival.label],
                "strength": rival.strength,
                "overlap": rival.overlap,
                "poses_can": not rival.mirror,
                "experiment": rival.experiment,
            }
            for first, rival in alike(power)
        ],
    }


def _effect(power: EffectPower) -> Mapping[str, Any]:
    return {
        "name": power.effect.name,
        "law": power.effect.law,
        "link": power.effect.link,
        "found_at_usual_size": power.detected,
        "strength": power.strength,
        "needed": power.needed,
        "smallest": {
            limit.name: {"value": limit.smallest, "usual": limit.typical, "unit": limit.unit}
            for limit in power.limits
        },
    }


def as_text(found: PlanPower) -> Group:
    """For people."""
    power, noise = found.power, found.power.noise
    head = (
        f"{power.frames} views of the board; noise ({found.noise_from}): corners"
        f" {noise.corner_px:g} px, flange {1e3 * noise.flange_m:g} mm and"
        f" {1e3 * noise.flange_rad:g} mrad. Smallest size found 9 times in 10, at 5 % false alarms"
        " over the whole catalogue:"
    )
    table = Table()
    for title in ("effect", "parameter", "smallest", "usual", "unit"):
        table.add_column(title, no_wrap=True)
    for effect in power.effects:
        _add(table, effect)
    parts: list[Any] = [head, table]
    parts += [f"cannot be seen: {name} ({why})" for name, why in power.unseen.items()]
    pairs = alike(power)
    if pairs:
        parts.append("could not be told apart at their usual size:")
    for first, rival in pairs:
        share = f"{100 * rival.overlap:.1f} %" if rival.overlap < 0.9995 else "all"
        parts.append(
            f"  {first.effect.label} and {rival.label}: the second mimics {share} of the first;"
            f" {rival.experiment}"
        )
    return Group(*parts)


def _add(table: Table, effect: EffectPower) -> None:
    missed = "" if effect.detected else " (missed at usual size)"
    for number, limit in enumerate(effect.limits):
        table.add_row(
            effect.effect.label + missed if number == 0 else "",
            limit.name,
            "none" if limit.smallest is None else f"{limit.smallest:.2g}",
            f"{limit.typical:.2g}",
            limit.unit,
        )
