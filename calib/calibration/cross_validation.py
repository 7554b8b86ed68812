"""Cross-validation over frames: whether other frames of the cell would give the same calibration.

The frames are dealt into folds, and the joint fit is repeated without each of them: the same
numbers free, noise levels and corner weights kept. `held_out` asks whether each of these fits
predicts the frames it never saw. Here the fits are held against the fit of all frames. A fit that
uses all data is efficient, so the variance of its difference from a fit of some of them is the
difference of their variances (Hausman 1978). Errors that go together within a frame, or drift from
the first frames to the last, move the folds by more than that. Each frame is also left out by
itself, to first order (Belsley, Kuh, Welsch 1980, chapter 2).

What is wrong alike in all frames, such as the scale of robot or board, shows in none of this.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.calibration.held_out import HeldOut, frame_by_frame, judge
from calib.calibration.quantities import quantities_of
from calib.distributions import chi2_tail, normal_limit
from calib.errors import CalibrationError
from calib.solver.elimination import UNDETERMINED, solve_scaled
from calib.solver.joint import JointFit, fit_joint
from calib.solver.unknowns import amounts, prior_information
from calib.views import FloatArray, Views

FOLDS = 5
FRAMES_NEEDED = 2 * FOLDS

SIGNIFICANT = 0.01
"""Each of three questions is answered wrongly so often where nothing is wrong."""

_MATTERS = 1.0
"""Sigmas by which a single frame must move an estimate to be named."""

_TREND = np.linspace(-1.0, 1.0, FOLDS) / np.linalg.norm(np.linspace(-1.0, 1.0, FOLDS))
"""From the fold of the earliest frames to that of the latest."""

_SEEN = 1e-3
"""Share of the largest variance below which a direction of a quantity is only rounding."""

_ROUNDING = 1e-4
"""Share of a mean variance that a difference of two variances cannot be trusted below."""

Verdict = Literal["agree", "sigma_too_small", "single_frames"]


@dataclass(frozen=True)
class Move:
    """How far the folds move one quantity, in units of what its uncertainty allows.

    Attributes
    ----------
    quantity:
        A name of `quantities_of`.
    largest_z, fold:
        The largest move of one of its numbers, and without which fold it is made.
    factor:
        RMS of the moves in all directions: how many times the stated sigma they ask for.
    p_value, drift_p_value:
        Of moves as large as these where the stated sigma is right; of moves that grow as much
        from the earliest frames to the latest.
    """

    quantity: str
    largest_z: float
    fold: int
    factor: float
    p_value: float
    drift_p_value: float


@dataclass(frozen=True)
class Pull:
    """A frame without which a quantity would be another one, by more than chance.

    `sigmas` is how far it moves, in sigmas of the fit of all frames; `z` in sigmas of the move.
    """

    frame: int
    quantity: str
    sigmas: float
    z: float


@dataclass(frozen=True)
class CrossValidation:
    """What repeating the fit without some of the frames says of it.

    Attributes
    ----------
    folds:
        Frame numbers of each fold.
    held_out:
        All frames, each predicted by the fit that had no say of it.
    moves, pulls:
        Of every quantity; the frames that carry one, the strongest first.
    """

    folds: tuple[tuple[int, ...], ...]
    held_out: HeldOut
    moves: tuple[Move, ...]
    pulls: tuple[Pull, ...]

    @property
    def too_far(self) -> tuple[Move, ...]:
        """The moves that are more than chance, the widest first."""
        limit = SIGNIFICANT / (2 * len(self.moves))
        found = (m for m in self.moves if min(m.p_value, m.drift_p_value) < limit)
        return tuple(sorted(found, key=lambda m: -m.factor))

    @property
    def drifting(self) -> tuple[Move, ...]:
        """Those that grow from the earliest frames to the latest more than chance has them do."""
        limit = SIGNIFICANT / (2 * len(self.moves))
        return tuple(m for m in self.too_far if m.drift_p_value < limit)

    @property
    def verdict(self) -> Verdict:
        """What to make of it; `single_frames` where only they carry an estimate."""
        if self.factor > 1.0:
            return "sigma_too_small"
        return "single_frames" if self.pulls else "agree"

    @property
    def factor(self) -> float:
        """How many times the stated sigma the frames ask for; one where they do not."""
        held = self.held_out
        over = [c.each**0.5 for c in (held.miss, held.robot, held.picture) if c.each > c.band[1]]
        return max([*over, *(m.factor for m in self.too_far)], default=1.0)


@dataclass(frozen=True)
class _Fold:
    """A fit without some frames: (p,) from the whole, (p, p) of that, and the frames judged."""

    moved: FloatArray
    variance: FloatArray
    held_out: HeldOut


def cross_validate(
    joint: JointFit, views: Views, distance_range_m: tuple[float, float]
) -> CrossValidation:
    """Repeat a joint fit without each fold of its frames.

    Parameters
    ----------
    joint, views:
        The fit, and the views that took part in it.
    distance_range_m:
        Nearest and farthest depth.

    Raises
    ------
    CalibrationError
        Too few frames, or those without a fold do not fix every number.
    """
    if len(views) < FRAMES_NEEDED:
        raise CalibrationError(
            f"{len(views)} frames took part in the joint fit; to leave out a fifth of them in turn"
            f" takes at least {FRAMES_NEEDED}"
        )
    p = len(joint.unknowns)
    frames = frame_by_frame(joint, joint.model, views, joint.weight, joint.flange_error)
    marginal = frames.marginal(joint.noise.flange_information)
    total = marginal[:, :p, :p].sum(axis=0) + prior_information(joint.unknowns)
    fold = fold_of(joint.dependence.state.distance_m)
    folds = [_without(fold == k, joint, views, marginal, total) for k in range(FOLDS)]
    quantities = quantities_of(joint, views, distance_range_m)
    held = reduce(add, (f.held_out for f in folds))
    moves = tuple(_move(name, rows, folds) for name, rows in quantities.items())
    return CrossValidation(
        tuple(tuple(int(f) for f in views.frame[fold == k]) for k in range(FOLDS)),
        held,
        moves,
        _pulls(views, marginal, total, quantities),
    )


def fold_of(distance_m: FloatArray) -> NDArray[np.int64]:
    """(N,) the fold of each frame, by the (N,) distances of the frames in their order.

    Frames of about one distance are dealt one to a fold, the earliest to the first: every fold has
    all distances, and what drifts with time differs between the first fold and the last.
    """
    order = np.argsort(distance_m, kind="stable")
    fold = np.empty(len(order), dtype=np.int64)
    for at in range(0, len(order), FOLDS):
        alike = np.sort(order[at : at + FOLDS])
        fold[alike] = np.arange(len(alike)) * FOLDS // len(alike)
    return fold


def _without(
    out: NDArray[np.bool_], joint: JointFit, views: Views, marginal: FloatArray, total: FloatArray
) -> _Fold:
    p, rest = len(joint.unknowns), ~out
    left = total - marginal[out, :p, :p].sum(axis=0)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(left), 1e-300))
    named = ", ".join(str(f) for f in views.frame[out])
    if np.linalg.eigvalsh(left * scale[:, None] * scale)[0] < UNDETERMINED:
        raise CalibrationError(f"without the frames {named} the others do not fix every number")
    fit = fit_joint(
        joint.model,
        views.take(rest),
        joint.unknowns,
        joint.noise,
        own_error=joint.own_error[rest],
        rounds=1,
        fixed_noise=True,
        weight=joint.weight[rest],
    )
    if not fit.converged:
        raise CalibrationError(
            f"without the frames {named} the joint fit does not come to rest: the others hardly fix"
            " every number"
        )
    before, after = (amounts(m, joint.unknowns, joint.model) for m in (joint.model, fit.model))
    variance = _inverse(left) - _inverse(total)
    return _Fold(after - before, variance, judge(fit, views.take(out), joint.weight[out]))


def _inverse(information: FloatArray) -> FloatArray:
    return solve_scaled(information, np.zeros(len(information)))[1]


def _move(name: str, rows: FloatArray, folds: Sequence[_Fold]) -> Move:
    """The folds' moves in the directions in which the quantity can move at all.

    The moves of K equal folds add up to nothing (what they have in common is the fit of all
    frames), hence K - 1 in their chi squares.
    """
    spread = np.array([rows @ f.variance @ rows.T for f in folds])
    moved = np.array([rows @ f.moved for f in folds])
    mean = spread.mean(axis=0)
    least = _ROUNDING * np.diag(mean)
    z = moved / np.sqrt(np.maximum(np.einsum("kqq->kq", spread), least))
    seen = _directions(mean)
    root = np.linalg.cholesky(seen @ spread @ seen.T + _ROUNDING * np.eye(len(seen)))
    unit = np.linalg.solve(root, (moved @ seen.T)[:, :, None])[:, :, 0]
    k, rank = unit.shape
    square, drift = float(np.sum(unit**2)), float(np.sum((_TREND @ unit) ** 2))
    worst, _ = np.unravel_index(np.argmax(np.abs(z)), z.shape)
    return Move(
        quantity=name,
        largest_z=float(np.abs(z).max()),
        fold=int(worst),
        factor=float(np.sqrt(square / (k * rank))),
        p_value=chi2_tail(square * (k - 1) / k, rank * (k - 1)),
        drift_p_value=chi2_tail(drift * (k - 1) / k, rank),
    )


def _directions(variance: FloatArray) -> FloatArray:
    """(s, r) independent combinations of r numbers, of variance one, without mere rounding."""
    unit = 1.0 / np.sqrt(np.diag(variance))
    value, vector = np.linalg.eigh(variance * unit[:, None] * unit)
    seen = value > _SEEN * value[-1]
    return np.asarray((vector[:, seen] / np.sqrt(value[seen])).T * unit)


def _pulls(
    views: Views, marginal: FloatArray, total: FloatArray, quantities: Mapping[str, FloatArray]
) -> tuple[Pull, ...]:
    p = len(total)
    rows = np.concatenate(list(quantities.values()))
    names = [name for name, r in quantities.items() for _ in r]
    covariance = _inverse(total)
    sigma = np.sqrt(np.einsum("qi,ij,qj->q", rows, covariance, rows))
    limit = normal_limit(SIGNIFICANT / (2 * len(views) * len(rows)))
    found = []
    for frame, one in zip(views.frame, marginal, strict=True):
        without = _inverse(total - one[:p, :p])
        move = rows @ (without @ -one[:p, p])
        variance = np.einsum("qi,ij,qj->q", rows, without - covariance, rows)
        z = np.abs(move) / np.sqrt(np.maximum(variance, _ROUNDING**2 * sigma**2))
        share = np.abs(move) / sigma
        deciding = np.where((z > limit) & (share > _MATTERS), share, 0.0)
        worst = int(deciding.argmax())
        if deciding[worst] > 0.0:
            found.append(Pull(int(frame), names[worst], float(share[worst]), float(z[worst])))
    return tuple(sorted(found, key=lambda pull: -pull.sigmas))
