"""A cell as the chain sees it, and its evaluation link by link."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from calib.chain import rigid
from calib.chain.effect import LINKS, Link, Present
from calib.chain.kinematics import ArmKinematics, arm
from calib.chain.state import ChainState
from calib.views import FloatArray, Views


@dataclass(frozen=True)
class CellModel:
    """The plain chain's constants and the effects that it leaves out.

    Attributes
    ----------
    optics:
        (K,) the camera, see `calib.chain.optics`.
    flange_from_mounted:
        (4, 4) flange_from_camera for an eye in hand, flange_from_board else.
    base_from_fixed:
        (4, 4) base_from_board for an eye in hand, base_from_camera else.
    effects:
        What departs from the plain chain, in any order; they are sorted by link.
    corner_offsets_m:
        (M, 3) where the printed corners lie off their grid, or None.
    """

    optics: FloatArray
    flange_from_mounted: FloatArray
    base_from_fixed: FloatArray
    effects: tuple[Present, ...] = field(default=())
    corner_offsets_m: FloatArray | None = None

    def with_effects(self, effects: Iterable[Present]) -> CellModel:
        """The same cell with these effects in place of its own."""
        return replace(self, effects=tuple(effects))


def kinematics_of(views: Views) -> ArmKinematics | None:
    """The kinematics of the logged arm, or None where model or joints are unknown."""
    if views.robot_model is None or not np.isfinite(views.joints_rad).any():
        return None
    return arm(views.robot_model)


def start(model: CellModel, views: Views, kinematics: ArmKinematics | None) -> ChainState:
    """The state before the first link: everything as logged and nominal."""
    n = len(views)
    points = views.board.corners_m
    if model.corner_offsets_m is not None:
        points = points + model.corner_offsets_m
    return ChainState(
        views=views,
        arm=kinematics,
        joints_rad=views.joints_rad,
        base_from_flange=views.base_from_flange,
        flange_from_mounted=np.repeat(model.flange_from_mounted[None], n, axis=0),
        base_from_fixed=np.repeat(model.base_from_fixed[None], n, axis=0),
        points_m=points.copy(),
        optics=np.repeat(model.optics[None], n, axis=0),
    )


Stage = int | Literal["arm", "place", "focus"]
"""A stage of the evaluation: an effect by its index, or what the chain itself does there."""


def stages(model: CellModel) -> tuple[Stage, ...]:
    """The stages in their order: effects by link, the arm after its own, then the pose.

    The focal length's own error comes last: it is about what the lens does, whatever that is.
    """

    def of(links: tuple[Link, ...]) -> list[int]:
        return [at for link in links for at, p in enumerate(model.effects) if p.effect.link == link]

    return (*of(LINKS[:2]), "arm", *of(LINKS[2:4]), "place", *of(LINKS[4:]), "focus")


@dataclass(frozen=True)
class Errors:
    """What scatters frame by frame about what the chain says; None where nothing does.

    Attributes
    ----------
    flange:
        (N, 6) small increment of the flange in its own frame, metres and radians.
    focal:
        (N,) error of the focal length as a share of it.
    """

    flange: FloatArray | None = None
    focal: FloatArray | None = None


EXACT = Errors()
"""Nothing scatters."""


def _call_at(evaluate: ChainState, stage: Stage, model: CellModel, errors: Errors) -> None:
    if stage == "place":
        evaluate.place()
    elif stage == "focus":
        if errors.focal is not None:
            for name in ("alpha_px", "beta_px"):
                evaluate.column(name)[:] *= 1.0 + errors.focal
    elif stage == "arm":
        evaluate.move_arm()
        if errors.flange is not None:
            error = rigid.from_vector(errors.flange)
            evaluate.base_from_flange = rigid.product(evaluate.base_from_flange, error)
    else:
        present = model.effects[stage]
        if not present.absent:
            present.effect.act(present.values, evaluate)


class StagedEvaluation:
    """An evaluation that can be resumed from any of its stages, with some constants changed.

    Before a stage nothing depends on what enters there: the arm need not be worked out anew for
    every number of the lens.

    Attributes
    ----------
    state:
        The state at the end.
    placed:
        The stage from which on the pose in the camera stays.
    """

    def __init__(
        self,
        model: CellModel,
        views: Views,
        *,
        kinematics: ArmKinematics | None = None,
        errors: Errors = EXACT,
    ) -> None:
        self.state = start(model, views, kinematics or kinematics_of(views))
        self._model, self._stages = model, stages(model)
        self._errors = errors
        self._before: list[ChainState] = []
        for stage in self._stages:
            self._before.append(self.state.copy())
            _call_at(self.state, stage, model, self._errors)
        self._before.append(self.state)
        self.placed = self._stages.index("place") + 1
        ahead = any(present.effect.looks_ahead for present in model.effects)
        self._poses = 0 if ahead else self._stages.index("arm")

    def entry(self, place: tuple[str, int, int]) -> int:
        """The stage at which a number, named as in `Unknown.place`, is first looked at."""
        kind, at, _ = place
        if kind == "optics":
            return self.placed
        return self._stages.index(at) if kind == "effect" else self._poses

    def from_stage(self, changed: CellModel, first: int) -> ChainState:
        """The state of a cell that differs only in what enters at stage `first` or later."""
        state = self._before[first].copy()
        n = len(state.views)
        if first <= self._poses:
            state.flange_from_mounted = np.repeat(changed.flange_from_mounted[None], n, axis=0)
            state.base_from_fixed = np.repeat(changed.base_from_fixed[None], n, axis=0)
        if first <= self.placed:
            state.optics = np.repeat(changed.optics[None], n, axis=0)
        return self._on(state, changed, first)

    def nudged(self, step: FloatArray) -> ChainState:
        """The state with every flange off by a (6,) increment more, in its own frame."""
        first = self._stages.index("arm") + 1
        state = self._before[first].copy()
        state.base_from_flange = rigid.product(state.base_from_flange, rigid.from_vector(step))
        return self._on(state, self._model, first)

    def _on(self, state: ChainState, model: CellModel, first: int) -> ChainState:
        for stage in self._stages[first:]:
            _call_at(state, stage, model, self._errors)
        return state


def evaluate(
    model: CellModel,
    views: Views,
    *,
    kinematics: ArmKinematics | None = None,
    errors: Errors = EXACT,
) -> ChainState:
    """ChainState the chain for every logged frame.

    Parameters
    ----------
    model, views:
        The cell, and the log (corners are not looked at).
    kinematics:
        The arm; looked up from the log where it is not given.
    errors:
        What scatters frame by frame, such as the robot's repeatability, or an estimate of it.

    Returns
    -------
    The state with `optics`, `camera_from_board` and `points_m` as the sensor sees them.
    """
    state = start(model, views, kinematics or kinematics_of(views))
    for stage in stages(model):
        _call_at(state, stage, model, errors)
    return state


def predict(model: CellModel, views: Views, *, errors: Errors = EXACT) -> FloatArray:
    """(N, M, 2) pixels at which this cell shows the corners at the logged poses."""
    return evaluate(model, views, errors=errors).pixels()
