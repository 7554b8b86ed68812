"""Monte Carlo: simulate a plan, calibrate, and hold the result against the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from rich.table import Table

from calib.calibration import calibrate
from cell.devices.log_mixups import MIXUPS
from cell.devices.simulated_cell import present_effect
from cell.storage.files.plan_file import Plan
from cell.storage.files.study_file import Case, Study
from cell.verbs.study.estimates import CAMERA_RMS, CAMERA_Z, COLUMN_OF, ROBOT, of_calibration
from cell.verbs.study.kinds.kind import Kind, Row, Task, grouped
from cell.verbs.study.rates import rate
from cell.verbs.study.trial import drawn, run_trial, truth_of

_WITHIN = 1.96
_SCALE = ("alpha_px", "alpha0_px", "alpha_inf_px")


@dataclass(frozen=True)
class Run(Task):
    """One seed of one case."""

    case: Case
    seed: int

    def asked(self) -> Row:
        """Case and seed."""
        return {"case": self.case.name, "seed": self.seed}


COLUMNS = (
    pa.field("case", pa.string()),
    pa.field("seed", pa.int64()),
    pa.field("drawn", pa.list_(pa.struct([("name", pa.string()), ("value", pa.float64())]))),
    pa.field("frames_used", pa.int32()),
    pa.field("frames_rejected", pa.int32()),
    pa.field("estimates", COLUMN_OF),
)


def _tasks(study: Study) -> list[Run]:
    asked, plan = study.file.monte_carlo, study.plan
    assert asked is not None
    assert plan is not None
    for case in asked.cases:
        _check(drawn(plan, case.effects, case.noise, 0)[0], f"{study.path}: case {case.name!r}")
    seeds = range(asked.first_seed, asked.first_seed + asked.seeds)
    pairs = [(case, seed) for case in asked.cases for seed in seeds]
    return [
        Run(number, f"{case.name}/seed {seed}", case, seed)
        for number, (case, seed) in enumerate(pairs)
    ]


def _check(plan: Plan, where: str) -> None:
    for effect in truth_of(plan).effects:
        if effect.name not in MIXUPS:
            present_effect(effect, where)


def _work(study: Study, run: Run) -> Row:
    assert study.plan is not None
    plan, values = drawn(study.plan, run.case.effects, run.case.noise, run.seed)
    trial = run_trial(plan, run.seed)
    found = calibrate(trial.views)
    return {
        "drawn": [{"name": name, "value": value} for name, value in values.items()],
        "frames_used": int(found.used.sum()),
        "frames_rejected": len(found.rejected),
        "estimates": [e.as_mapping() for e in of_calibration(found, trial)],
    }


def _summary(rows: Sequence[Row]) -> Mapping[str, Any]:
    cases = [
        {"case": case, "runs": len(own), "solutions": _solutions(own)}
        for case, own in grouped(rows, "case")
    ]
    return {"cases": cases}


def _solutions(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """By solution: every quantity's errors, and all together in sigmas."""
    reported = [estimate for row in rows for estimate in row["estimates"]]
    found = []
    for name, own in grouped(reported, "of"):
        z = [e["z"] for e in own if e["z"] is not None]
        found.append(
            {
                "of": name,
                "within_95": rate([abs(v) < _WITHIN for v in z]),
                "z_rms": _rms(z),
                "quantities": [_quantity(q, e) for q, e in grouped(own, "quantity")],
            }
        )
    return found


def _quantity(name: str, estimates: Sequence[Row]) -> dict[str, Any]:
    error = [e["error"] for e in estimates if e["error"] is not None]
    z = [e["z"] for e in estimates if e["z"] is not None]
    sigma = [e["sigma"] for e in estimates if e["sigma"] is not None]
    return {
        "quantity": name,
        "runs": len(estimates),
        "mean_error": float(np.mean(error)) if error else None,
        "rms_error": _rms(error),
        "rms_sigma": _rms(sigma),
        "z_rms": _rms(z),
        "within_95": rate([abs(v) < _WITHIN for v in z]),
    }


def _rms(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _tables(summary: Mapping[str, Any]) -> Sequence[Table]:
    return [_table(case) for case in summary["cases"]]


def _table(case: Mapping[str, Any]) -> Table:
    table = Table(title=f"{case['case']}: {case['runs']} runs", title_justify="left")
    table.add_column("solution", no_wrap=True)
    for title in _TITLES:
        table.add_column(title, justify="right", no_wrap=True)
    for solution in case["solutions"]:
        by_name = {q["quantity"]: q for q in solution["quantities"]}
        scale: Mapping[str, Any] = next((by_name[n] for n in _SCALE if n in by_name), {})
        z, rms = by_name.get(CAMERA_Z, {}), by_name.get(CAMERA_RMS, {})
        share = solution["within_95"]["share"]
        table.add_row(
            "camera, board on robot" if solution["of"] == ROBOT else solution["of"],
            _number(scale.get("mean_error"), 1.0, "+.2f"),
            _number(scale.get("rms_error"), 1.0, ".2f"),
            _number(z.get("mean_error"), 1e3, "+.2f"),
            _number(rms.get("rms_error"), 1e3, ".2f"),
            _number(solution["z_rms"], 1.0, ".2f"),
            _number(share, 100.0, ".0f"),
        )
    return table


_TITLES = ("α off px", "rms", "z off mm", "rms mm", "err/σ", "in 95 %")
"""Mean and rms error of the scale factor; mean error of the camera's place along its axis, rms of
its whole; rms of all errors in sigmas, and how many per cent of them are within 1.96."""


def _number(value: float | None, scale: float, form: str) -> str:
    return "-" if value is None else format(scale * value, form)


KIND = Kind(COLUMNS, _tasks, _work, _summary, _tables)
