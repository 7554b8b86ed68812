"""For every effect: found at its size, and the twin with it explains a recording of its own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calib.chain.effect import Effect, Present
from calib.chain.effects import catalogue
from calib.discovery.diagnose import diagnose
from calib.discovery.diagnosis import Diagnosis
from calib.discovery.locate import locate
from calib.discovery.residual_structure import ALARM
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from calib.views import FloatArray, Views
from cell.devices.simulated_cell import home_of, log_of, simulated_cell
from cell.storage.files.plan_file import read_plan
from cell.verbs.diagnose.twin import twin_text
from sim.synthesize import synthesize
from tests.discovery.simulated_runs import log, plain_cell, record, recording

pytestmark = pytest.mark.slow

FRAMES = 30
EFFECTS = {effect.label: effect for effect in catalogue()}


def log_for(effect: Effect) -> Views:
    views = log(FRAMES, moving=effect.moving_only)
    if "exposure_s" in effect.varies:
        rng = np.random.default_rng(4)
        exposure_s = rng.choice([0.004, 0.008, 0.012, 0.02], len(views))
        gain_db = rng.choice([0.0, 3.0, 6.0], len(views))
        views = replace(views, exposure_s=exposure_s, extra={"gain_db": gain_db})
    return views


def truth(effect: Effect) -> Present:
    """Usual amounts with mixed signs, or a smooth curve of them; shapes in the middle."""
    rng = np.random.default_rng(len(effect.label))
    shapes = list(effect.candidates(log_for(effect)))
    values = effect.values(shapes[len(shapes) // 2])
    for k, parameter in enumerate(effect.parameters):
        if parameter.role == "amount" and parameter.identifiable:
            sign = rng.choice([-1.0, 1.0]) if parameter.low < 0.0 else 1.0
            values[k] = sign * parameter.typical
    if effect.roughness:  # what a curve may bend by from node to node has a prior
        nodes = [k for k, p in enumerate(effect.parameters) if p.role == "amount"]
        along = np.arange(len(nodes))
        values[nodes] = values[nodes[0]] * (len(nodes) - along) * (1.0 - 0.05 * along)
    return Present(effect, values)


def without_amounts(present: Present) -> Present:
    shape = [p.role != "amount" for p in present.effect.parameters]
    return Present(present.effect, np.where(shape, present.values, 0.0))


@cache
def found(label: str) -> Diagnosis:
    present = truth(EFFECTS[label])
    views = record(plain_cell().with_effects([present]), log_for(present.effect), seed=len(label))
    return diagnose(views, forced=[without_amounts(present)])


def misses(label: str) -> FloatArray:
    """Fitted minus true amounts, in the sigmas reported."""
    present = truth(EFFECTS[label])
    (named,) = found(label).effects
    return np.array(
        [
            (named.parameters[p.name].value - value) / named.parameters[p.name].sigma
            for p, value in zip(present.effect.parameters, present.values, strict=True)
            if p.role == "amount" and p.identifiable
        ]
    )


def resimulated(diagnosis: Diagnosis, path: Path) -> Views:
    """The recording that `cell simulate` makes of the twin."""
    path.write_text(twin_text(diagnosis, recording()))
    plan = read_plan(path)
    cell = simulated_cell(plan.cell, home_of(plan), seed=5)
    return synthesize(cell, log_of(plan, cell))


@pytest.mark.parametrize("label", EFFECTS)
def test_the_amounts_are_found(label):
    assert np.abs(misses(label)).max() < 4.5


@pytest.mark.parametrize("label", EFFECTS)
def test_nothing_is_left_between_the_twin_and_its_own_recording(label, tmp_path):
    twin = found(label).twin
    again = resimulated(found(label), tmp_path / "twin.yaml")
    again = again.take(again.seen.any(axis=1))
    assert len(again) >= FRAMES - 2
    fitter = Fitter(again)
    fit = fitter.fit(twin.model, twin.noise)
    assert fit.noise.corner_px == pytest.approx(twin.noise.corner_px, rel=0.1)
    cells = locate(fit, again)
    assert cells[0].p_value * len(cells) >= ALARM
    search = Search(fit, fitter)
    search.run()
    assert search.steps == []


def test_the_sigmas_are_right_over_all_effects():
    every = np.concatenate([misses(label) for label in EFFECTS])
    assert len(every) > 60
    assert 0.75 < np.sqrt(np.mean(every**2)) < 1.25
    assert 0.90 <= np.mean(np.abs(every) < 1.96) <= 1.0
