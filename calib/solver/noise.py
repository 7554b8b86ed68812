"""Noise levels of corners, robot and print, estimated from the data and never typed in.

Variance components of a linear mixed model: corner noise, the flange's scatter about the logged
pose (translation and rotation), and where asked for the printed corners' scatter about their grid
and the focal length's about its law.
Restricted maximum likelihood (Patterson, Thompson 1971) estimates them without the bias that the
fitted parameters would bring in; plain maximum likelihood compares models that differ in their
parameters (Pinheiro, Bates 2000, section 2.2.5).
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields, replace

import numpy as np
from scipy.optimize import minimize

from calib.solver.elimination import FrameEquations, Reduced, eliminate, solve_scaled
from calib.views import FloatArray


@dataclass(frozen=True)
class Noise:
    """One-sigma levels.

    Attributes
    ----------
    corner_px:
        Of a detected corner, per axis.
    flange_m, flange_rad:
        Of the flange about its logged pose, per axis, in the flange's own frame.
    print_m:
        Of a printed corner about its grid, per axis in the board's plane; zero: held to the grid.
    focal:
        Of the focal length about its law, frame by frame, as a share of it; zero: held to the law.
    """

    corner_px: float
    flange_m: float
    flange_rad: float
    print_m: float = 0.0
    focal: float = 0.0

    @property
    def flange_information(self) -> FloatArray:
        """(6, 6) inverse covariance of the flange's error."""
        return np.diag([self.flange_m**-2.0] * 3 + [self.flange_rad**-2.0] * 3)

    @property
    def own_information(self) -> FloatArray:
        """(F, F) inverse covariance of a frame's own numbers: the flange's six, the focal one."""
        if self.focal == 0.0:
            return self.flange_information
        return np.diag([*np.diag(self.flange_information), self.focal**-2.0])

    @property
    def log_det_own(self) -> float:
        """Log-determinant of their covariance."""
        return -float(np.log(np.diag(self.own_information)).sum())

    def near(self, other: Noise, share: float) -> bool:
        """Whether every level differs from the other's by less than this share of it."""
        return bool(np.allclose(astuple(self), astuple(other), rtol=share, atol=0.0))


LEAST = Noise(1e-4, 1e-7, 1e-7, 1e-7, 1e-7)
MOST = Noise(50.0, 0.3, 1.0, 5e-3, 0.1)
START_AT_LEAST = Noise(1e-3, 1e-5, 1e-5, 3e-6, 3e-5)
"""Below these the likelihood is flat: a search that starts there never finds its way back."""


@dataclass(frozen=True)
class JointEquations:
    """Normal equations of the joint problem at unit corner noise, without any prior.

    Attributes
    ----------
    frames:
        Equations in each frame's own F numbers (the flange's six, and the focal length's error
        where it scatters) and the shared ones; the last `corner_numbers` of the shared ones are
        shifts of single corners.
    own_error, corner_shift, amount:
        (N, F), (C,) and (p,) where the unknowns with a prior stand now.
    amount_information:
        (p, p) inverse covariance of the amounts' priors.
    corner_numbers, observations:
        C and the number of scalar observations, each counted by its weight.
    """

    frames: FrameEquations
    own_error: FloatArray
    corner_shift: FloatArray
    amount: FloatArray
    amount_information: FloatArray
    corner_numbers: int
    observations: float


@dataclass(frozen=True)
class Profile:
    """The joint problem at given noise levels with everything but the noise solved for.

    Attributes
    ----------
    step, covariance:
        (p + C,) and its (p + C, p + C) covariance.
    reduced:
        The eliminated equations.
    minus_two_log:
        -2 log of the marginal likelihood; restricted where asked for.
    square_sum:
        What the quadratic form keeps at its minimum, in units of the noise.
    """

    step: FloatArray
    covariance: FloatArray
    reduced: Reduced
    minus_two_log: float
    square_sum: float


def scaled(
    equations: JointEquations, noise: Noise, damping: float = 0.0
) -> tuple[Reduced, FloatArray]:
    """Equations with noise levels and priors put in, frames eliminated; and the shared prior."""
    frames, information = equations.frames, noise.corner_px**-2.0
    prior = noise.own_information
    shared_at = np.concatenate([equations.amount, equations.corner_shift])
    shared_prior = _shared_prior(equations, noise)
    pull = equations.own_error @ prior
    shared_pull = shared_prior @ shared_at
    square = float(np.sum(equations.own_error * pull)) + float(shared_pull @ shared_at)
    weighted = FrameEquations(
        own=frames.own * information,
        own_shared=frames.own_shared * information,
        own_residual=frames.own_residual * information - pull,
        shared=frames.shared * information + shared_prior,
        shared_residual=frames.shared_residual * information - shared_pull,
        square_sum=frames.square_sum * information + square,
    )
    return eliminate(weighted, prior, damping), shared_prior


def _shared_prior(equations: JointEquations, noise: Noise) -> FloatArray:
    """(p + C, p + C) inverse covariance of all priors of the shared numbers."""
    p, c = len(equations.amount), equations.corner_numbers
    information = np.zeros((p + c, p + c))
    information[:p, :p] = equations.amount_information
    if c:
        information[range(p, p + c), range(p, p + c)] = noise.print_m**-2.0
    return information


def profile(equations: JointEquations, noise: Noise, *, restricted: bool = True) -> Profile:
    """Solve the joint problem at these noise levels and say how likely the data then are."""
    return _profile(equations, noise, restricted)[0]


def _profile(
    equations: JointEquations, noise: Noise, restricted: bool
) -> tuple[Profile, FloatArray]:
    """The profile; and the covariance of those last shared numbers that are integrated out."""
    reduced, _ = scaled(equations, noise)
    step, covariance, log_det = solve_scaled(reduced.shared, reduced.shared_residual)
    square_sum = reduced.square_sum - float(step @ reduced.shared_residual)
    c, n = equations.corner_numbers, len(equations.own_error)
    minus_two_log = (
        equations.observations * 2.0 * np.log(noise.corner_px)
        + n * noise.log_det_own
        + reduced.log_det_own
        + square_sum
    )
    integrated = covariance if restricted else np.zeros((0, 0))
    if c:
        minus_two_log += c * 2.0 * np.log(noise.print_m)
    if restricted:
        minus_two_log += log_det
    elif c:
        block = reduced.shared[-c:, -c:]
        _, integrated, log_det = solve_scaled(block, np.zeros(c))
        minus_two_log += log_det
    return Profile(step, covariance, reduced, float(minus_two_log), square_sum), integrated


def _slope(
    equations: JointEquations, noise: Noise, found: Profile, integrated: FloatArray
) -> dict[str, float]:
    """Derivatives of -2 log likelihood by the logarithm of each level.

    By the square sum at its minimum only the levels themselves count (the envelope theorem); by
    the log-determinants the posterior variances of all that is integrated out do: what data and
    prior leave of a level's own prior variance.
    """
    reduced, c = found.reduced, equations.corner_numbers
    first = len(found.step) - len(integrated)
    back = reduced.back[:, :, first:]
    own = equations.own_error + reduced.at_zero - reduced.back @ found.step
    variance = np.einsum("nii->ni", reduced.own_covariance)
    variance = variance + np.sum((back @ integrated) * back, axis=2)
    information = np.diag(noise.own_information)
    # of each prior: how many numbers, less what is left of their variance, less their squares
    kept = information * variance.sum(axis=0)
    square = information * np.sum(own**2, axis=0)
    shared = np.concatenate([equations.amount, equations.corner_shift]) + found.step
    prior = _shared_prior(equations, noise)
    shared_kept = np.sum(prior[first:, first:] * integrated, axis=1)
    shared_square = shared * (prior @ shared)
    n = len(own)
    rank = float(np.sum(integrated * reduced.shared[first:, first:]))
    freedom = n * own.shape[1] + rank - kept.sum() - shared_kept.sum()
    data = found.square_sum - square.sum() - shared_square.sum()
    by_prior = n - kept - square
    slope = {
        "corner_px": equations.observations - freedom - data,
        "flange_m": by_prior[:3].sum(),
        "flange_rad": by_prior[3:6].sum(),
        "focal": by_prior[6:].sum(),
        "print_m": c
        - shared_kept[len(shared_kept) - c :].sum()
        - shared_square[len(prior) - c :].sum(),
    }
    return {name: 2.0 * float(value) for name, value in slope.items()}


def _levels(noise: Noise, estimated: tuple[str, ...]) -> FloatArray:
    return np.log([getattr(noise, name) for name in estimated])


def _units(equations: JointEquations, estimated: tuple[str, ...]) -> FloatArray:
    """Roots of the information on the levels' logarithms: the search is as steep along each.

    Of n normal numbers of one level -2 log likelihood has the second derivative 4 n.
    """
    frames = len(equations.own_error)
    counts = {
        "corner_px": equations.observations,
        "flange_m": 3.0 * frames,
        "flange_rad": 3.0 * frames,
        "print_m": float(equations.corner_numbers),
        "focal": float(frames),
    }
    return np.array([np.sqrt(4.0 * max(counts[name], 1.0)) for name in estimated])


def estimate_noise(
    equations: JointEquations, guess: Noise, *, restricted: bool = True
) -> tuple[Noise, float]:
    """Noise levels that make the data most likely, and -2 log likelihood there.

    Those of print and focal length stay at zero where the guess has them there.
    """
    estimated = tuple(f.name for f in fields(Noise) if getattr(guess, f.name) > 0.0)
    low, high = _levels(LEAST, estimated), _levels(MOST, estimated)
    start = np.maximum(_levels(guess, estimated), _levels(START_AT_LEAST, estimated))
    start = np.minimum(start, high - 0.1)
    unit = _units(equations, estimated)

    def at(place: FloatArray) -> Noise:
        levels = np.exp(place / unit).tolist()
        return replace(guess, **dict(zip(estimated, levels, strict=True)))

    def cost(place: FloatArray) -> tuple[float, FloatArray]:
        noise = at(place)
        found, integrated = _profile(equations, noise, restricted)
        slope = _slope(equations, noise, found, integrated)
        return found.minus_two_log, np.array([slope[name] for name in estimated]) / unit

    found = minimize(
        cost,
        start * unit,
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(low * unit, high * unit, strict=True)),
        options={"maxiter": 40, "ftol": 1e-9},
    )
    return at(found.x), float(found.fun)
