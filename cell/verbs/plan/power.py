"""`cell plan --power`: what a plan would reveal, before anything is recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from rich.console import Group
from rich.table import Table

from calib.discovery.design.power import EffectPower, Power, alike, plan_power
from cell.devices.nominal_cell import nominal
from cell.devices.simulated_cell import home_of, log_of, simulated_cell
from cell.storage.files.plan_file import SCHEMA as PLAN_SCHEMA
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.files.yaml_model import read_mapping
from cell.verbs.plan.nominal import assumed_noise

_WIDTH = 100


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


def power_of(plan: Plan) -> PlanPower:
    """Say what a plan would reveal of the plain cell.

    Raises
    ------
    InputError
        The cell states neither `simulation` nor `layout`, or a view cannot be reached.
    """
    cell = nominal(plan.cell)
    plan = Plan(plan.path, plan.file, cell)
    simulated = simulated_cell(cell, home_of(plan))
    noise, noise_from = assumed_noise(plan.cell)
    log = log_of(plan, simulated)
    return PlanPower(plan_power(simulated.model.with_effects(()), log, noise), noise_from)


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


def as_shares(found: PlanPower) -> dict[str, float | None]:
    """For each effect the size found 9 times in 10 as a share of its usual one; None: never."""
    return {
        e.effect.label: float(np.sqrt(e.needed / e.strength)) if e.strength > 0 else None
        for e in found.power.effects
    }


def as_lines(found: PlanPower) -> list[str]:
    """The short of it, for people."""
    power, shares = found.power, as_shares(found)
    reported = ", ".join(
        "{} {}".format(k, "-" if v is None else f"{v:.2g}") for k, v in shares.items()
    )
    missed = [e.effect.label for e in power.effects if not e.detected]
    pairs = [f"{first.effect.label} and {rival.label}" for first, rival in alike(power)]
    text = f"effects it would reveal, at this share of their usual size: {reported}"
    lines = fill(text, _WIDTH, subsequent_indent="  ").splitlines()
    if missed:
        lines.append(f"missed at their usual size: {', '.join(missed)}")
    lines += [f"cannot be seen: {name} ({why})" for name, why in power.unseen.items()]
    if pairs:
        text = f"could not be distinguished: {'; '.join(pairs)}"
        lines += fill(text, _WIDTH, subsequent_indent="  ").splitlines()
    return [*lines, "sizes with their units: `cell plan --power` with the plan's name"]


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
        parts.append("could not be distinguished at their usual size:")
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
