"""A cell's pixels as a function of its free numbers, by the oracle alone."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import autograd.numpy as anp
import numpy as np

from calib.chain.effect import Present
from calib.chain.kinematics import arm
from calib.chain.model import CellModel
from calib.chain.optics import OPTICS
from calib.solver.unknowns import Unknown
from calib.views import FloatArray, Views
from tests.chain.oracle import curves, formulas
from tests.chain.oracle.effects import ORACLES
from tests.chain.oracle.formulas import Array
from tests.chain.oracle.scene import ORDER, Acting, Oracle, Scene, evaluate, pixels


def oracle_of(present: Present) -> Oracle:
    """What stands beside that effect; a clear failure where nothing does."""
    effect = present.effect
    if effect.name == "empirical":
        site, _, covariate = str(effect.law).partition("/")
        return partial(curves.shift, site, covariate)
    if effect.label not in ORACLES:
        raise AssertionError(
            f"{effect.label} has no oracle: say in tests/chain/oracle/effects.py by another formula"
            " what it does, so that its values and derivatives are checked"
        )
    return ORACLES[effect.label]


class Run:
    """The pixels of one cell by `unknowns` and, last, the six of the flange's error."""

    def __init__(
        self,
        model: CellModel,
        views: Views,
        unknowns: Sequence[Unknown],
        flange_error: FloatArray,
    ) -> None:
        assert views.robot_model is not None
        self.model, self.views, self.unknowns = model, views, unknowns
        self.flange_error = flange_error
        self.dh = arm(views.robot_model).dh
        self.oracles = [oracle_of(present) for present in model.effects]

    def pixels(self, x: Array, frame: int, corners: Sequence[int]) -> Array:
        """(C, 2) of those corners after an increment (p + 6,) of everything that is free."""
        scene = self._scene(x, frame)
        effects = self._effects(x)
        error = anp.dot(formulas.rigid(self.flange_error[frame]), formulas.rigid(x[-6:]))
        evaluate(scene, effects, error, ORDER[:4])
        if frame:
            scene.focused_before = lambda: self._focused(formulas.plain(x), frame - 1)
        evaluate(scene, effects, error, ORDER[4:])
        return pixels(scene, corners)

    def _focused(self, x: FloatArray, frame: int) -> Array:
        scene = self._scene(x, frame)
        evaluate(scene, self._effects(x), formulas.rigid(self.flange_error[frame]), ORDER[:4])
        return scene.focused

    def _scene(self, x: Array, frame: int) -> Scene:
        optics: dict[str, Array] = dict(zip(OPTICS, self.model.optics, strict=True))
        step: dict[str, list[Array]] = {
            place: [0.0] * 6 for place in ("flange_from_mounted", "base_from_fixed")
        }
        for k, unknown in enumerate(self.unknowns):
            kind, at, _ = unknown.place
            if kind == "optics":
                optics[OPTICS[at]] = optics[OPTICS[at]] + x[k]
            elif kind != "effect":
                step[kind][at] = x[k]
        scene = Scene(self.views, frame, self.dh, optics)
        mounted = formulas.rigid(anp.stack(step["flange_from_mounted"]))
        scene.mounted = anp.dot(self.model.flange_from_mounted, mounted)
        fixed = formulas.rigid(anp.stack(step["base_from_fixed"]))
        scene.fixed = anp.dot(self.model.base_from_fixed, fixed)
        return scene

    def _effects(self, x: Array) -> Acting:
        numbers: list[dict[str, Array]] = [dict(p.as_mapping()) for p in self.model.effects]
        for k, unknown in enumerate(self.unknowns):
            kind, at, parameter = unknown.place
            if kind == "effect":
                name = self.model.effects[at].effect.parameters[parameter].name
                numbers[at][name] = numbers[at][name] + x[k]
        return [
            (present.effect.link, oracle, given)
            for present, oracle, given in zip(
                self.model.effects, self.oracles, numbers, strict=True
            )
        ]


def zero(unknowns: Sequence[Unknown]) -> FloatArray:
    return np.zeros(len(unknowns) + 6)
