"""One maximum-likelihood fit of everything, with the robot's poses as noisy observations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.chain import rigid
from calib.chain.kinematics import ArmKinematics
from calib.chain.model import CellModel, Errors, evaluate, kinematics_of
from calib.chain.projection import project
from calib.solver.accumulate import LocalEquations, local_equations
from calib.solver.elimination import FrameEquations, joined, solve_scaled
from calib.solver.noise import JointEquations, Noise, Profile, estimate_noise, profile, scaled
from calib.solver.unknowns import (
    Dependence,
    Unknown,
    amounts,
    dependence,
    moved,
    prior_information,
)
from calib.views import FloatArray, Views

GOOD_SIGMA = 3.0
"""A corner within this many sigma of its place counts fully."""
_FIRST_DAMPING = 1e-6
SETTLED = 0.02
"""Weights that change by less, and noise levels by less of themselves, move no estimate."""
BLOCK_FRAMES = 64
"""Frames whose products are at hand together: they stay in the cache, and memory stays small."""


def frame_errors(own_error: FloatArray) -> Errors:
    """(N, 6) errors of the flange, or (N, 7) with that of the focal length, for `evaluate`."""
    return Errors(own_error[:, :6], own_error[:, 6] if own_error.shape[1] > 6 else None)


@dataclass(frozen=True)
class JointState:
    """Where the fit stands: the cell, each frame's own errors, and the noise.

    (N, 6) errors of the flange; (N, 7) with that of the focal length where it scatters.
    """

    model: CellModel
    own_error: FloatArray
    noise: Noise


@dataclass(frozen=True)
class JointFit:
    """The result of `fit_joint`.

    Attributes
    ----------
    model, noise, own_error:
        The cell, the noise levels, and each frame's errors, see `JointState`.
    unknowns, covariance:
        The p free numbers and their (p, p) covariance.
    residual_px:
        (N, M, 2) observed minus predicted with the flange errors put in, NaN where not seen.
    weight:
        (N, M) how much each corner counts; one for a good one.
    minus_two_log:
        -2 log marginal likelihood (not restricted), to compare models of the same data.
    profile, equations, dependence:
        The linearised problem at the optimum, for tests of what is missing.
    """

    model: CellModel
    noise: Noise
    own_error: FloatArray
    unknowns: tuple[Unknown, ...]
    covariance: FloatArray
    residual_px: FloatArray
    weight: FloatArray
    minus_two_log: float
    profile: Profile
    equations: JointEquations
    dependence: Dependence
    converged: bool

    @property
    def flange_error(self) -> FloatArray:
        """(N, 6) the flange's errors in its own frame."""
        return self.own_error[:, :6]

    @property
    def parameters(self) -> int:
        """How many numbers are free, without those that have a prior."""
        return len(self.unknowns)

    def sigma(self, name: str) -> float:
        """One-sigma uncertainty of the free number of that name."""
        at = [u.name for u in self.unknowns].index(name)
        return float(np.sqrt(self.covariance[at, at]))


def _with_corners(
    local: LocalEquations,
    own: FloatArray,
    mapping: FloatArray,
    equations: FrameEquations,
) -> FrameEquations:
    """Append each corner's own in-plane shift to the shared numbers."""
    assert local.cross is not None
    assert local.own is not None
    n, m = local.own.shape[:2]
    cross = local.cross.reshape(n, 2 * m, -1)
    followed, p = own.shape[1], mapping.shape[2]
    own_corner = np.einsum("nqk,ncq->nkc", own, cross[:, :, :followed])
    shared_corner = np.einsum("ncq,nqp->pc", cross[:, :, :-1], mapping, optimize=True)
    shared = np.zeros((p + 2 * m, p + 2 * m))
    shared[:p, :p] = equations.shared
    shared[:p, p:] = shared_corner
    shared[p:, :p] = shared_corner.T
    blocks = local.own.sum(axis=0)
    at = p + 2 * np.arange(m)
    for i in range(2):
        for j in range(2):
            shared[at + i, at + j] = blocks[:, i, j]
    return FrameEquations(
        own=equations.own,
        own_shared=np.concatenate([equations.own_shared, own_corner], axis=2),
        own_residual=equations.own_residual,
        shared=shared,
        shared_residual=np.concatenate([equations.shared_residual, cross[:, :, -1].sum(axis=0)]),
        square_sum=equations.square_sum,
    )


def _in_shared_numbers(
    local: LocalEquations, own: FloatArray, mapping: FloatArray
) -> FrameEquations:
    """A block's equations in its frames' own numbers and the shared ones."""
    gram, followed = local.gram, own.shape[1]
    own_t = np.swapaxes(own, 1, 2)
    mapped = gram[:, :-1, :-1] @ mapping
    n, q, p = mapping.shape
    frames = FrameEquations(
        own=own_t @ gram[:, :followed, :followed] @ own,
        own_shared=own_t @ mapped[:, :followed],
        own_residual=(own_t @ gram[:, :followed, -1:])[:, :, 0],
        shared=mapping.reshape(n * q, p).T @ mapped.reshape(n * q, p),
        shared_residual=np.einsum("nqi,nq->i", mapping, gram[:, :-1, -1]),
        square_sum=float(gram[:, -1, -1].sum()),
    )
    return frames if local.own is None else _with_corners(local, own, mapping, frames)


def assemble(
    found: Dependence,
    views: Views,
    weight: FloatArray,
    own_error: FloatArray,
    corner_shift: FloatArray | None,
    prior: tuple[FloatArray, FloatArray],
) -> tuple[JointEquations, FloatArray]:
    """Normal equations in the frames' own errors and shared numbers; and (N, M, 2) residuals.

    `prior` has how far the p shared numbers are from the centres of their priors, and the inverse
    covariance of these.
    """
    state = found.state
    parts: list[FrameEquations] = []
    residual = np.empty(views.corners_px.shape)
    for first in range(0, len(views), BLOCK_FRAMES):
        block = slice(first, first + BLOCK_FRAMES)
        local = local_equations(
            state.optics[block],
            state.camera_from_board[block],
            state.points_m,
            state.straightened(views.corners_px[block]),
            weight[block],
            found.active,
            found.modes,
            corners=corner_shift is not None,
        )
        residual[block] = local.residual_px
        parts.append(_in_shared_numbers(local, found.own[block], found.local[block]))
    equations = JointEquations(
        frames=joined(parts),
        own_error=own_error,
        corner_shift=np.zeros(0) if corner_shift is None else corner_shift,
        amount=prior[0],
        amount_information=prior[1],
        corner_numbers=0 if corner_shift is None else len(corner_shift),
        observations=2.0 * float(weight.sum()),
    )
    return equations, residual


def _robust_weight(residual_px: FloatArray, sigma_px: float) -> FloatArray:
    """(N, M) one up to three sigma, then falling with the fourth power of the distance.

    A redescending weight (Hampel et al. 1986, section 2.6): a good corner keeps its full say, so
    that the noise is not underestimated, and a wrong one loses it.
    """
    square = np.nansum(residual_px**2, axis=2) / (GOOD_SIGMA * sigma_px) ** 2
    weight = np.where(square > 1.0, 1.0 / np.maximum(square, 1.0) ** 2, 1.0)
    return np.where(np.isfinite(residual_px).all(axis=2), weight, 0.0)


class _Iteration:
    """Levenberg-Marquardt on the joint problem; noise and weights follow now and then."""

    def __init__(
        self,
        state: JointState,
        views: Views,
        unknowns: tuple[Unknown, ...],
        arm: ArmKinematics | None,
        weight: FloatArray | None,
        about: CellModel | None,
    ) -> None:
        self.views, self.unknowns, self.arm, self.about = views, unknowns, arm, about
        self.information = prior_information(unknowns)
        self.state = state
        self.with_print = state.noise.print_m > 0.0
        self.robust = weight is None
        self.weight = views.seen.astype(np.float64) if weight is None else weight
        self.damping = _FIRST_DAMPING
        self.linearise()

    def linearise(self) -> None:
        self.found = dependence(
            self.state.model,
            self.views,
            self.unknowns,
            kinematics=self.arm,
            errors=frame_errors(self.state.own_error),
        )
        self.equations, self.residual = self._assemble(self.found, self.state)

    def _assemble(self, found: Dependence, at: JointState) -> tuple[JointEquations, FloatArray]:
        shift = _shift_of(at.model, self.views) if self.with_print else None
        prior = (amounts(at.model, self.unknowns, self.about), self.information)
        return assemble(found, self.views, self.weight, at.own_error, shift, prior)

    def cost(self, at: JointState) -> float:
        """Penalised square sum at that state, for the present weights."""
        seen = evaluate(
            at.model, self.views, kinematics=self.arm, errors=frame_errors(at.own_error)
        )
        pixels = project(seen.optics, seen.camera_from_board, seen.points_m)
        square = np.nansum((seen.straightened(self.views.corners_px) - pixels) ** 2, axis=2)
        cost = float(np.sum(self.weight * square)) / at.noise.corner_px**2
        pull = at.own_error @ at.noise.own_information
        cost += float(np.sum(pull * at.own_error))
        amount = amounts(at.model, self.unknowns, self.about)
        cost += float(amount @ self.information @ amount)
        if self.with_print:
            cost += float(np.sum(_shift_of(at.model, self.views) ** 2)) / at.noise.print_m**2
        return cost

    def _cost_here(self) -> float:
        """The same at the present state, whose residuals the equations have already."""
        found, noise = self.equations, self.state.noise
        cost = found.frames.square_sum / noise.corner_px**2
        cost += float(np.sum(found.own_error @ noise.own_information * found.own_error))
        cost += float(found.amount @ found.amount_information @ found.amount)
        if self.with_print:
            cost += float(np.sum(found.corner_shift**2)) / noise.print_m**2
        return cost

    def step(self) -> bool:
        """Take one step that lowers the cost; True when nothing is left to gain."""
        noise = self.state.noise
        before = self._cost_here()
        while self.damping < 1e8:
            trial = self._trial(noise)
            after = self.cost(trial)
            if after <= before * (1.0 + 1e-12):
                self.state = trial
                self.damping = max(self.damping * 0.1, 1e-10)
                self.linearise()
                return before - after < 1e-7 * before + 1e-4
            self.damping = max(self.damping * 10.0, 1e-6)
        return True

    def _trial(self, noise: Noise) -> JointState:
        reduced, _ = scaled(self.equations, noise, self.damping)
        matrix = reduced.shared + self.damping * np.diag(np.diag(reduced.shared))
        step, _, _ = solve_scaled(matrix, reduced.shared_residual)
        own = reduced.at_zero - reduced.back @ step
        p = len(self.unknowns)
        model = moved(self.state.model, self.unknowns, step[:p])
        if self.with_print:
            model = _with_shift(model, self.views, step[p:])
        error = self.state.own_error + own
        flange = rigid.from_vector(self.state.own_error[:, :6]) @ rigid.from_vector(own[:, :6])
        error[:, :6] = rigid.to_vector(flange)
        return replace(self.state, model=model, own_error=error)

    def refresh(self, *, noise: bool) -> bool:
        """Estimate the noise anew, and the corners' weights unless they are given.

        True where either changed by more than the estimates care for.
        """
        changed = False
        if noise:
            level, _ = estimate_noise(self.equations, self.state.noise)
            changed = not level.near(self.state.noise, SETTLED)
            self.state = replace(self.state, noise=level)
        if self.robust:
            weight = _robust_weight(self.residual, self.state.noise.corner_px)
            moved_by = float(np.abs(weight - self.weight).max())
            changed = changed or moved_by > SETTLED
            if moved_by > 0.0:
                self.weight = weight
                self.equations, self.residual = self._assemble(self.found, self.state)
        self.damping = _FIRST_DAMPING  # a search that has settled ends with a high one
        return changed


def _shift_of(model: CellModel, views: Views) -> FloatArray:
    if model.corner_offsets_m is None:
        return np.zeros(2 * views.board.corner_count)
    return model.corner_offsets_m[:, :2].ravel()


def _with_shift(model: CellModel, views: Views, step: FloatArray) -> CellModel:
    offsets = np.zeros((views.board.corner_count, 3))
    offsets[:, :2] = (_shift_of(model, views) + step).reshape(-1, 2)
    return replace(model, corner_offsets_m=offsets)


def fit_joint(
    model: CellModel,
    views: Views,
    unknowns: tuple[Unknown, ...],
    noise: Noise,
    *,
    own_error: FloatArray | None = None,
    rounds: int = 10,
    fixed_noise: bool = False,
    weight: FloatArray | None = None,
    kinematics: ArmKinematics | None = None,
    about: CellModel | None = None,
) -> JointFit:
    """Fit the free numbers of a cell, each flange's error, and the noise levels.

    Parameters
    ----------
    model:
        Start; its transforms must be roughly right (a hand-eye solution is).
    views:
        Frames that all have a logged pose and corners.
    unknowns:
        What is free, see `unknowns_of`.
    noise:
        Start of the noise levels; `print_m` above zero frees every corner within the board's
        plane, `focal` above zero every frame's focal length, with that prior.
    own_error:
        Start of the frames' own errors, see `JointState`; zero where it is not given.
    rounds:
        How often noise and weights are estimated anew at most; they are until they stay.
    fixed_noise:
        Keep the noise levels as given.
    weight:
        (N, M) what each corner counts, kept as it is: likelihoods of models are comparable only
        for the same weights. Estimated robustly where None.
    about:
        What the priors of optics and transforms are centred on, for unknowns that have one.

    Raises
    ------
    ValueError
        When a frame has no pose.
    """
    if not views.has_pose.all():
        raise ValueError("every frame of a joint fit needs base_from_flange")
    error = np.zeros((len(views), 7 if noise.focal > 0.0 else 6))
    if own_error is not None:
        known = min(error.shape[1], own_error.shape[1])
        error[:, :known] = own_error[:, :known]
    arm = kinematics or kinematics_of(views)
    run = _Iteration(JointState(model, error, noise), views, unknowns, arm, weight, about)
    settled = False
    for attempt in range(rounds):
        settled = False
        for _ in range(20):
            settled = run.step()
            if settled:
                break
        last = attempt == rounds - 1
        if (last and fixed_noise) or not run.refresh(noise=not fixed_noise):
            break
    run.step()
    return _result(run, settled)


def _result(run: _Iteration, settled: bool) -> JointFit:
    found = profile(run.equations, run.state.noise, restricted=False)
    p = len(run.unknowns)
    return JointFit(
        model=run.state.model,
        noise=run.state.noise,
        own_error=run.state.own_error,
        unknowns=run.unknowns,
        covariance=found.covariance[:p, :p],
        residual_px=run.residual,
        weight=run.weight,
        minus_two_log=found.minus_two_log,
        profile=found,
        equations=run.equations,
        dependence=run.found,
        converged=settled,
    )
