"""Power of a plan: simulate it with one effect at a time, and see what the diagnosis names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa
from rich.table import Table

from calib.chain.effect import Present
from calib.chain.effects import catalogue
from calib.discovery.design.power import usual_shape
from calib.discovery.diagnose import diagnose
from calib.discovery.diagnosis import Diagnosis
from cell.devices.simulated_cell import home_of, log_of, present_effect, simulated_cell
from cell.storage.files.cell_file import EffectFile
from cell.storage.files.plan_file import Plan
from cell.storage.files.study_file import Study
from cell.verbs.simulate import with_truth
from cell.verbs.study.estimates import COLUMN_OF, of_effect
from cell.verbs.study.kinds.kind import Kind, Row, Task, grouped
from cell.verbs.study.rates import as_percent, rate
from cell.verbs.study.trial import drawn, run_trial, truth_of

NONE = "no effect"
"""What a run of the cell without any effect is called."""


@dataclass(frozen=True)
class Run(Task):
    """One seed of one effect at one size; of the plain cell where there is no effect."""

    effect: EffectFile | None
    label: str
    size: float
    seed: int

    def asked(self) -> Row:
        """Effect, size and seed."""
        return {"effect": self.label, "size": self.size, "seed": self.seed}


COLUMNS = (
    pa.field("effect", pa.string()),
    pa.field("size", pa.float64()),
    pa.field("seed", pa.int64()),
    pa.field("verdict", pa.string()),
    pa.field("named", pa.list_(pa.string())),
    pa.field("rivals", pa.list_(pa.string())),
    pa.field("detected", pa.bool_()),
    pa.field("found", pa.bool_()),
    pa.field("alone", pa.bool_()),
    pa.field("estimates", COLUMN_OF),
)


def _tasks(study: Study) -> list[Run]:
    asked, plan = study.file.power, study.plan
    assert asked is not None
    assert plan is not None
    where = f"{study.path}: power.effects"
    given = None if asked.effects is None else [present_effect(e, where) for e in asked.effects]
    effects = _everything(plan) if given is None else given
    cells: list[tuple[EffectFile | None, str, float]] = [(None, NONE, 0.0)]
    cells += [(_at(e, size), e.effect.label, size) for e in effects for size in asked.sizes]
    seeds = range(asked.first_seed, asked.first_seed + asked.seeds)
    runs = [(*cell, seed) for cell in cells for seed in seeds]
    return [
        Run(number, f"{label} x {size:g}/seed {seed}", effect, label, size, seed)
        for number, (effect, label, size, seed) in enumerate(runs)
    ]


def _everything(plan: Plan) -> list[Present]:
    """Every effect that the plan's log can show, but for the free curve, which has no one size."""
    log = log_of(plan, simulated_cell(plan.cell, home_of(plan)))
    return [
        Present(effect, usual_shape(effect, log))
        for effect in catalogue()
        if effect.missing(log) is None and effect.law != "free"
    ]


def _at(given: Present, size: float) -> EffectFile:
    """The effect with its amounts, or their usual ones where none is given, times the size."""
    parameters = {}
    for parameter, value in zip(given.effect.parameters, given.values.tolist(), strict=True):
        if parameter.role == "amount":
            usual = parameter.typical if parameter.identifiable else 0.0
            value = size * (usual if given.absent else value)
        parameters[parameter.name] = value
    return EffectFile(name=given.effect.name, law=given.effect.law, parameters=parameters)


def _work(study: Study, run: Run) -> Row:
    asked = study.file.power
    assert asked is not None
    assert study.plan is not None
    plan, _ = drawn(study.plan, None, asked.noise, run.seed)
    effects = () if run.effect is None else (run.effect,)
    plan = with_truth(plan, truth_of(plan).model_copy(update={"effects": effects}))
    trial = run_trial(plan, run.seed)
    found = diagnose(trial.views)
    return {
        **_answer(found, None if run.effect is None else run.effect.name),
        "estimates": [e.as_mapping() for effect in found.effects for e in of_effect(effect, trial)],
    }


def _answer(found: Diagnosis, true: str | None) -> Row:
    """What the diagnosis made of it; `detected` is anything but silence."""
    named = [effect.name for effect in found.effects]
    rivals = {name for pair in found.ambiguous_with for name in pair.names} - set(named)
    return {
        "verdict": found.verdict,
        "named": named,
        "rivals": sorted(rivals),
        "detected": found.verdict != "consistent",
        "found": true in named,
        "alone": named == [true],
    }


def _summary(rows: Sequence[Row]) -> Mapping[str, Any]:
    cells = [
        (effect, size, runs)
        for effect, own in grouped(rows, "effect")
        for size, runs in grouped(own, "size")
    ]
    return {
        "effects": [
            {
                "effect": effect,
                "size": size,
                **{name: rate([row[name] for row in runs]) for name in _RATES},
                "taken_for": _taken_for(runs),
            }
            for effect, size, runs in cells
        ]
    }


_RATES = ("detected", "found", "alone")


def _taken_for(rows: Sequence[Row]) -> dict[str, int]:
    """What was named in runs that did not name the right one, and how often."""
    names = [name for row in rows if not row["found"] for name in row["named"]]
    return {name: names.count(name) for name in sorted(set(names))}


def _tables(summary: Mapping[str, Any]) -> Sequence[Table]:
    table = Table()
    table.add_column("effect", no_wrap=True)
    for title in ("size", "detected", "named", "named alone"):
        table.add_column(title, justify="right")
    table.add_column("named instead")
    for cell in summary["effects"]:
        plain = cell["effect"] == NONE
        instead = ", ".join(f"{name} ({count})" for name, count in cell["taken_for"].items())
        rates = [
            as_percent(cell["detected"]),
            *("-" if plain else as_percent(cell[n]) for n in _RATES[1:]),
        ]
        table.add_row(cell["effect"], "-" if plain else f"{cell['size']:g}", *rates, instead)
    return [table]


KIND = Kind(COLUMNS, _tasks, _work, _summary, _tables)
