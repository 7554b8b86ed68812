"""New pictures held against an old calibration that may be off only as far as it stated itself.

The old numbers are the truth plus an error with the covariance that their fit gave; each logged
flange pose is off by the arm's scatter; a corner by its noise. What changed since is a further
number added to some of the old ones, of which nothing is known beforehand. All of it is one
least-squares problem (Gauss-Newton, the frames' own numbers eliminated), and what freeing a group
of changes takes off its minimum is a chi square with as many degrees of freedom as it has numbers
where nothing changed (Wilks 1938).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain import rigid
from calib.chain.model import CellModel, Errors, evaluate
from calib.chain.projection import project
from calib.solver.elimination import Reduced, solve_scaled
from calib.solver.joint import assemble
from calib.solver.noise import JointEquations, Noise, scaled
from calib.solver.unknowns import Unknown, dependence, moved
from calib.views import FloatArray, Views
from cell.verbs.verify.old_cell import OldCell

_WIDE = {"alpha_px": 0.05, "beta_px": 0.05, "u0_px": 0.05, "v0_px": 0.05}
"""How wide a change may be, as a share of the number itself: far more than any lens does."""

_WIDE_PLACE_M, _WIDE_PLACE_RAD = 0.3, 0.3
_WIDE_COEFFICIENT = {"k1": 0.3, "k2": 1.0, "p1": 0.03, "p2": 0.03, "k3": 3.0}
_WIDE_TYPICAL = 30.0
_STEPS = 30
_SETTLED = 1e-3
"""In units of chi square."""


@dataclass(frozen=True)
class Change:
    """The best explanation of new pictures with some groups of numbers free to have changed.

    Attributes
    ----------
    at:
        (Q,) places among the old cell's unknowns that may have changed.
    values, covariance:
        (Q,) by how much, and (Q, Q).
    chi2:
        What the best explanation leaves, in units of all uncertainties.
    model, flange_error:
        The cell now, and (N, 6) the flange's errors.
    residual_px:
        (N, M, 2) observed minus predicted; NaN where not seen.
    absorbed:
        How many of the frames' own numbers the pictures decide and not the arm's scatter.
    """

    at: NDArray[np.int64]
    values: FloatArray
    covariance: FloatArray
    chi2: float
    model: CellModel
    flange_error: FloatArray
    residual_px: FloatArray
    absorbed: float


def explain(
    old: OldCell,
    views: Views,
    weight: FloatArray,
    noise: Noise,
    free: tuple[str, ...] = (),
    board_at: FloatArray | None = None,
) -> Change:
    """Fit the old cell's error, the flanges' errors, and what is free to have changed.

    Parameters
    ----------
    old, views, weight:
        The calibration; new frames, all with poses; (N, M) what each corner counts.
    noise:
        Of corners and flange now.
    free:
        Groups of `OldCell.group` that may have changed.
    board_at:
        (4, 4) about where the board is now, where it is free.
    """
    start = old.model
    if board_at is not None:
        start = _with_board(old, board_at)
    return _Fit(old, views, weight, noise, free, start).run()


def _with_board(old: OldCell, board_at: FloatArray) -> CellModel:
    if old.mount == "eye_in_hand":
        return replace(old.model, base_from_fixed=board_at)
    return replace(old.model, flange_from_mounted=board_at)


@dataclass(frozen=True)
class _State:
    z: FloatArray
    flange_error: FloatArray


class _Fit:
    """Levenberg-Marquardt in the old cell's error (P numbers) and the changes (Q)."""

    def __init__(
        self,
        old: OldCell,
        views: Views,
        weight: FloatArray,
        noise: Noise,
        free: tuple[str, ...],
        start: CellModel,
    ) -> None:
        self.old, self.views, self.weight, self.noise = old, views, weight, noise
        self.start = start
        self.at = np.concatenate([np.zeros(0, dtype=np.int64), *(old.group(g) for g in free)])
        p = len(old.unknowns)
        self.spread = np.hstack([np.eye(p), np.eye(p)[:, self.at]])
        self.prior = _prior(old, self.at)

    def model(self, state: _State) -> CellModel:
        return moved(self.start, self.old.unknowns, self.spread @ state.z)

    def cost(self, state: _State) -> float:
        seen = evaluate(self.model(state), self.views, errors=Errors(state.flange_error))
        pixels = project(seen.optics, seen.camera_from_board, seen.points_m)
        square = np.nansum((seen.straightened(self.views.corners_px) - pixels) ** 2, axis=2)
        cost = float((self.weight * square).sum()) / self.noise.corner_px**2
        error = state.flange_error
        cost += float(np.sum((error @ self.noise.flange_information) * error))
        return cost + float(state.z @ self.prior @ state.z)

    def equations(self, state: _State) -> tuple[JointEquations, FloatArray]:
        found = dependence(
            self.model(state),
            self.views,
            self.old.unknowns,
            kinematics=None,
            errors=Errors(state.flange_error),
        )
        none = np.zeros(len(self.old.unknowns))
        return assemble(found, self.views, self.weight, state.flange_error, None, (none, none))

    def run(self) -> Change:
        state = _State(np.zeros(self.spread.shape[1]), np.zeros((len(self.views), 6)))
        cost, damping = self.cost(state), 1e-6
        for _ in range(_STEPS):
            equations, _ = self.equations(state)
            while damping < 1e8:
                trial = self.step(state, equations, damping)
                after = self.cost(trial)
                if after <= cost * (1 + 1e-12):
                    break
                damping = max(damping * 10, 1e-6)
            else:
                break
            gained, state, cost = cost - after, trial, after
            damping = max(damping * 0.1, 1e-12)
            if gained < _SETTLED:
                break
        return self.result(state, cost)

    def step(self, state: _State, equations: JointEquations, damping: float) -> _State:
        reduced, _ = scaled(equations, self.noise, damping)
        matrix = self.spread.T @ reduced.shared @ self.spread + self.prior
        right = self.spread.T @ reduced.shared_residual - self.prior @ state.z
        dz, _, _ = solve_scaled(matrix + damping * np.diag(np.diag(matrix)), right)
        own = reduced.at_zero - reduced.back @ (self.spread @ dz)
        error = rigid.to_vector(rigid.from_vector(state.flange_error) @ rigid.from_vector(own))
        return _State(state.z + dz, error)

    def result(self, state: _State, cost: float) -> Change:
        equations, residual = self.equations(state)
        reduced, _ = scaled(equations, self.noise)
        matrix = self.spread.T @ reduced.shared @ self.spread + self.prior
        p = len(self.old.unknowns)
        _, covariance, _ = solve_scaled(matrix, np.zeros(len(matrix)))
        return Change(
            at=self.at,
            values=state.z[p:],
            covariance=covariance[p:, p:],
            chi2=cost,
            model=self.model(state),
            flange_error=state.flange_error,
            residual_px=residual,
            absorbed=_absorbed(reduced, self.noise),
        )


def _absorbed(reduced: Reduced, noise: Noise) -> float:
    kept = reduced.own_covariance @ noise.flange_information
    return float(6 * len(kept) - np.einsum("nii->", kept))


def _prior(old: OldCell, at: NDArray[np.int64]) -> FloatArray:
    """(P + Q, P + Q) information beforehand: of the old numbers, and nearly none of changes."""
    p = len(old.unknowns)
    prior = np.zeros((p + len(at), p + len(at)))
    prior[:p, :p] = solve_scaled(old.covariance, np.zeros(p))[1]
    sigma = np.array([wide(old.model, old.unknowns[int(k)]) for k in at])
    prior[range(p, p + len(at)), range(p, p + len(at))] = sigma**-2.0
    return prior


def wide(model: CellModel, unknown: Unknown) -> float:
    """One sigma of a change of a number before a picture is seen: more than ever happens."""
    kind, at, _ = unknown.place
    if kind == "optics":
        if unknown.name in _WIDE:
            return abs(float(model.optics[at])) * _WIDE[unknown.name]
        return _WIDE_COEFFICIENT.get(unknown.name, 1.0)
    if kind == "effect":
        return _WIDE_TYPICAL * unknown.typical
    return _WIDE_PLACE_M if unknown.unit == "m" else _WIDE_PLACE_RAD
