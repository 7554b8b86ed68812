"""One simulated run: the plan with what this seed draws, its recording, and its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.chain.model import Errors, evaluate
from calib.chain.state import ChainState
from calib.views import Views
from cell.devices.simulated_cell import home_of, log_of, simulated_cell
from cell.storage.files.cell_file import EffectFile, Simulation
from cell.storage.files.plan_file import Plan
from cell.storage.files.study_file import LevelSpread, Spread, VariedEffect, VariedNoise
from cell.verbs.simulate import simulated_views, with_truth
from sim.cell import ARM_STREAM, SimulatedCell

_DRAW_STREAM = 102


@dataclass(frozen=True)
class Trial:
    """A run of the simulated cell.

    Attributes
    ----------
    cell:
        Its truth.
    views:
        What it recorded.
    truth:
        Where everything truly was in each frame, the arm's scatter included.
    """

    cell: SimulatedCell
    views: Views
    truth: ChainState


def run_trial(plan: Plan, seed: int) -> Trial:
    """Simulate a plan in memory; raises `InputError` where it cannot be."""
    cell = simulated_cell(plan.cell, home_of(plan), seed=seed)
    views = simulated_views(plan, cell)
    scatter = cell.repeatability.draw(cell.random(ARM_STREAM), (len(views),))
    return Trial(cell, views, evaluate(cell.model, log_of(plan, cell), errors=Errors(scatter)))


def drawn(
    plan: Plan, effects: Sequence[VariedEffect] | None, noise: VariedNoise, seed: int
) -> tuple[Plan, dict[str, float]]:
    """The plan with this seed's effects and noise, and by name what was drawn for it.

    Parameters
    ----------
    plan:
        Its cell has a `simulation` section.
    effects:
        In place of the cell's own where they are not None.
    noise:
        Levels in place of the cell's own.
    seed:
        Draws depend on it alone.
    """
    truth, draw = truth_of(plan), _Draw(seed)
    if effects is not None:
        truth = truth.model_copy(update={"effects": tuple(draw.effect(e) for e in effects)})
    levels = {
        name: draw.value(f"noise.{name}", level) for name, level in noise if level is not None
    }
    truth = truth.model_copy(update={"noise": truth.noise.model_copy(update=levels)})
    return with_truth(plan, truth), draw.values


def truth_of(plan: Plan) -> Simulation:
    """The truth of a study's cell; reading the study has made sure that it has one."""
    truth = plan.cell.simulation
    assert truth is not None
    return truth


class _Draw:
    """Values in the order in which they are asked for, remembered by name where they were drawn."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng([seed, _DRAW_STREAM])
        self.values: dict[str, float] = {}

    def effect(self, effect: VariedEffect) -> EffectFile:
        parameters = {
            key: self.value(f"{effect.name}.{key}", value)
            for key, value in effect.parameters.items()
        }
        return EffectFile(name=effect.name, law=effect.law, parameters=parameters)

    def value(
        self, name: str, value: float | tuple[float, ...] | Spread | LevelSpread
    ) -> float | tuple[float, ...]:
        if not isinstance(value, Spread | LevelSpread):
            return value
        if isinstance(value, Spread) and value.normal is not None:
            self.values[name] = float(self._rng.normal(*value.normal))
        else:
            assert value.uniform is not None
            self.values[name] = float(self._rng.uniform(*value.uniform))
        return self.values[name]
