"""Score tests: how much better would the fit be with these columns, judged from one fit.

Rao's score test on the marginal likelihood, in which each frame's flange error and each corner's
print error have been integrated out: the columns are whitened by what the robot's noise could
have done. On raw pixel residuals the same test would flag every clean recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.chain.effect import Present
from calib.chain.model import kinematics_of
from calib.distributions import f_tail
from calib.solver.elimination import solve_scaled
from calib.solver.joint import JointFit, assemble, frame_errors
from calib.solver.noise import JointEquations, scaled
from calib.solver.unknowns import (
    Dependence,
    Unknown,
    amount_unknowns,
    dependence,
    prior_information,
)
from calib.solver.unknowns import amounts as amounts_of
from calib.views import FloatArray, Views


@dataclass(frozen=True)
class Score:
    """What a group of columns would gain.

    Attributes
    ----------
    gain:
        Drop of -2 log likelihood to be expected, noise levels unchanged.
    columns:
        How many independent columns the group has, given what is fitted already.
    p_value:
        Of the gain under the null, by an F distribution with the frames' six numbers each.
    step:
        (e,) one-step estimate of the columns' amounts.
    information, gradient:
        (e, e) and (e,) of the columns, all else projected out.
    """

    gain: float
    columns: int
    p_value: float
    step: FloatArray
    information: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    gradient: FloatArray = field(default_factory=lambda: np.zeros(0))


def pose_numbers(views: Views) -> int:
    """Six numbers a frame: how many independent data an effect in the pose channel has."""
    return 6 * len(views)


def bic(gain: float, columns: int, views: Views) -> float:
    """Gain less the Bayesian price of the columns (Schwarz 1978), data counted as poses."""
    return gain - columns * float(np.log(pose_numbers(views)))


def conditional(
    equations: JointEquations, fit: JointFit, extra: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Information and score of the extra columns, everything fitted projected out."""
    reduced, _ = scaled(equations, fit.noise)
    is_extra = np.zeros(len(reduced.shared_residual), dtype=bool)
    is_extra[extra] = True
    base = ~is_extra
    cross = reduced.shared[np.ix_(base, is_extra)]
    _, inverse, _ = solve_scaled(reduced.shared[np.ix_(base, base)], np.zeros(int(base.sum())))
    carried = inverse @ cross
    information = reduced.shared[np.ix_(is_extra, is_extra)] - cross.T @ carried
    score = reduced.shared_residual[is_extra] - carried.T @ reduced.shared_residual[base]
    return 0.5 * (information + information.T), score


def group_score(information: FloatArray, score: FloatArray, views: Views, price: int = 0) -> Score:
    """Test one group of columns by its information and score; `price` adds to the columns."""
    diagonal = np.sqrt(np.maximum(np.diag(information), 1e-300))
    value, vector = np.linalg.eigh(information / diagonal[:, None] / diagonal[None, :])
    kept = value > 1e-7
    along = (vector[:, kept].T @ (score / diagonal)) / np.sqrt(value[kept])
    gain, columns = float(along @ along), int(kept.sum()) + price
    step = (vector[:, kept] / np.sqrt(value[kept])) @ along / diagonal
    if columns == 0:
        return Score(0.0, 0, 1.0, step, information, score)
    freedom = max(pose_numbers(views) - columns - 14, 4)
    p_value = f_tail(gain / columns, columns, freedom)
    return Score(gain, columns, p_value, step, information, score)


def extended(
    fit: JointFit,
    views: Views,
    extra: Sequence[Present],
) -> tuple[JointEquations, Dependence, tuple[Unknown, ...], int]:
    """The linearised problem of a fit with the extra effects' amounts as further columns.

    Returns
    -------
    Equations, dependence, all unknowns (the fit's first), and how many are the fit's.
    """
    model = fit.model.with_effects((*fit.model.effects, *extra))
    base = len(fit.unknowns)
    amounts = amount_unknowns(model, fit.unknowns)
    unknowns = (*fit.unknowns, *amounts)
    found = dependence(
        model, views, unknowns, kinematics=kinematics_of(views), errors=frame_errors(fit.own_error)
    )
    shift = fit.equations.corner_shift if fit.equations.corner_numbers else None
    prior = (amounts_of(model, unknowns), prior_information(unknowns))
    equations, _ = assemble(found, views, fit.weight, fit.own_error, shift, prior)
    return equations, found, unknowns, base


def score_effects(
    fit: JointFit,
    views: Views,
    candidates: Sequence[Present],
) -> list[Score]:
    """One score for each candidate effect, all from one linearisation."""
    if not candidates:
        return []
    equations, _, unknowns, base = extended(fit, views, candidates)
    columns = np.arange(base, len(unknowns))
    information, score = conditional(equations, fit, columns)
    owner = np.array([u.place[1] for u in unknowns[base:]])
    first = len(fit.model.effects)
    scores = []
    for index, present in enumerate(candidates):
        mine = np.flatnonzero(owner == first + index)
        shapes = sum(p.role == "shape" for p in present.effect.parameters)
        part = information[np.ix_(mine, mine)]
        scores.append(group_score(part, score[mine], views, price=shapes))
    return scores
