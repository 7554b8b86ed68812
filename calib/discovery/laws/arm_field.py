"""Whether the arm's scatter is a smooth field over its joints, and the field itself.

The frames' own errors are compared by their marginal likelihood: scattering freely, or a share of
their variance being alike in poses near to each other. All that is fitted (hand-eye, board,
camera) is integrated out.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calib.chain.effect import Present
from calib.chain.empirical import UNNAMED
from calib.chain.laws.arm_field import FIELD, coordinates, likeness, over, present_field
from calib.discovery.laws.frames import FrameNormals, frame_normals
from calib.discovery.locate import Cell
from calib.discovery.score import Score, pose_numbers
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from calib.distributions import chi2_tail
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views

_LENGTHS = (0.15, 0.3, 0.6, 1.2, 2.4)
_SHARES = (0.3, 0.6, 0.8, 0.95)
_SIZES = (0.7, 1.0, 1.5)
_WORTH = 14.0
"""By which a field must lower -2 log likelihood: 0.001 for three numbers, and their choice."""

_REPEATABLE_M, _REPEATABLE_RAD = 2e-4, 5e-4
"""No industrial arm scatters so much about a pose it returns to: ISO 9283 figures of arms up to
2 m reach are 0.01 to 0.1 mm."""

_WORTH_BEYOND = 4.0
"""The same where the arm scatters more than any does: that something is there need not be shown."""

_SEEN = 0.3
"""What the corners' noise does to a frame's pose, as a share of the arm's scatter: corners of one
picture that err alike do three times as much, and where that is the scatter it is not the arm's."""

_NUMBERS = 3
"""Of a field: its size, length scale and share."""

_POSE_LINKS = ("arm", "mount", "board")

_FEWEST_FRAMES, _MOST_FRAMES = 12, 80
"""Of more frames every so many are compared: the field's size and length show in these."""


@dataclass(frozen=True)
class ArmField:
    """A field and what it gains in -2 log likelihood over free scatter."""

    present: Present
    gain: float


class _Scatter:
    """The frames' own errors as far as the pictures show them, in units of the noise."""

    def __init__(self, fit: JointFit, views: Views) -> None:
        self.unit = np.array([fit.noise.flange_m] * 3 + [fit.noise.flange_rad] * 3)
        normals = frame_normals(fit, views)
        scale = fit.noise.corner_px**-2.0
        self.places = coordinates(views, over(views))
        self._measured(normals, fit, scale)

    def _measured(self, normals: FrameNormals, fit: JointFit, scale: float) -> None:
        own = normals.own * scale * self.unit[:, None] * self.unit[None, :]
        cross = normals.cross * scale * self.unit[:, None]
        pulled = normals.own_residual * scale * self.unit
        self.noise = np.linalg.inv(own)
        back = self.noise @ cross
        n, f, t = cross.shape
        self.error = (
            fit.own_error / self.unit + np.einsum("nij,nj->ni", self.noise, pulled)
        ).ravel()
        self.design = back.reshape(n * f, t)
        self.information = normals.prior + scale * normals.shared.sum(axis=0)
        self.information -= np.einsum("nft,nfs->ts", cross, back)
        self.gradient = normals.pull + scale * normals.gradient.sum(axis=0)
        self.gradient -= np.einsum("nft,nf->t", back, pulled)

    @property
    def is_seen(self) -> bool:
        """Whether the pictures show the frames' errors well enough for these to be the arm's."""
        variance = np.einsum("nii->ni", self.noise)
        return float(np.sqrt(variance.mean())) < _SEEN

    def thinned(self) -> _Scatter:
        """Every so many of the frames; what the pictures say of the shared numbers stays."""
        every = -(-len(self.places) // _MOST_FRAMES)
        few = copy(self)
        few.places, few.noise = self.places[::every], self.noise[::every]
        few.error = self.error.reshape(-1, 6)[::every].ravel()
        design = self.design.reshape(len(self.places), 6, -1)[::every]
        few.design = design.reshape(-1, design.shape[2])
        return few

    def judged(self, alike: FloatArray, share: float, size: float) -> tuple[float, FloatArray]:
        """-2 log likelihood but for a constant, and (N, 6) weights of the field."""
        n = len(self.places)
        spread = size * (share * alike + (1.0 - share) * np.eye(n))
        covariance = np.kron(spread, np.eye(6))
        for k in range(n):
            covariance[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += self.noise[k]
        factor = cho_factor(covariance, lower=True)
        solved = cho_solve(factor, np.column_stack([self.error, self.design]))
        information = self.information + self.design.T @ solved[:, 1:]
        right = self.gradient + self.design.T @ solved[:, 0]
        unit = 1.0 / np.sqrt(np.diag(information))
        normal = information * unit[:, None] * unit[None, :]
        step = unit * np.linalg.lstsq(normal, unit * right, rcond=1e-10)[0]
        log_det = 2.0 * float(np.log(np.diag(factor[0])).sum())
        value = np.linalg.eigvalsh(normal)
        log_det += float(np.log(value[value > 1e-10]).sum() - 2.0 * np.log(unit).sum())
        quadratic = float(self.error @ solved[:, 0] - right @ step)
        weights = size * share * (solved[:, 0] - solved[:, 1:] @ step)
        return log_det + quadratic, weights.reshape(n, 6) * self.unit

    def rms_sigma(
        self, alike: FloatArray, share: float, size: float, weights: FloatArray
    ) -> tuple[float, float]:
        """Sigmas of the field's RMS over the recorded poses, metres and radians.

        By the field's own posterior covariance; that of hand-eye and board is absorbed by these.
        """
        n, prior = len(self.places), size * share * alike
        covariance = np.kron(prior + size * (1.0 - share) * np.eye(n), np.eye(6))
        for k in range(n):
            covariance[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += self.noise[k]
        whole = np.kron(prior, np.eye(6))
        left = whole - whole @ cho_solve(cho_factor(covariance, lower=True), whole)
        field = alike @ weights
        sigma = []
        for axes in (slice(0, 3), slice(3, 6)):
            rms = float(np.sqrt((field[:, axes] ** 2).sum(axis=1).mean()))
            slope = np.zeros((n, 6))
            slope[:, axes] = field[:, axes] / (n * max(rms, 1e-300))
            along = (slope * self.unit).ravel()
            sigma.append(float(np.sqrt(max(along @ left @ along, 0.0))))
        return sigma[0], sigma[1]


def find_arm_field(fit: JointFit, views: Views) -> ArmField | None:
    """The field that the arm's errors demand; None where nothing says that they are alike."""
    if len(views) < _FEWEST_FRAMES or fit.own_error.shape[1] != 6:
        return None
    whole = _Scatter(fit, views)
    scatter = whole.thinned()
    free = min(scatter.judged(np.eye(len(scatter.places)), 0.0, size)[0] for size in _SIZES)
    tries = [
        (scatter.judged(likeness(scatter.places, scatter.places, length), share, size)[0], *rest)
        for length in _LENGTHS
        for share in _SHARES
        for size in _SIZES
        for rest in [(length, share, size)]
    ]
    reached, length, share, size = min(tries)
    certain = scatters_too_much(fit) and whole.is_seen
    if reached > free - (_WORTH_BEYOND if certain else _WORTH):
        return None
    loss = np.array([one[0] for one in tries])
    sigmas = (
        length * _sigma(loss, np.log([one[1] for one in tries]), np.log(_LENGTHS)),
        _sigma(loss, np.array([one[2] for one in tries]), np.array(_SHARES)),
    )
    return ArmField(_made(whole, views, (length, share, size), sigmas), free - reached)


def _sigma(loss: FloatArray, place: FloatArray, grid: FloatArray) -> float:
    """Sigma of a number tried on a grid, from -2 log likelihood; no less than the grid resolves."""
    weight = np.exp(-0.5 * (loss - loss.min()))
    mean = np.average(place, weights=weight)
    step = float(np.diff(grid).mean())
    return float(np.sqrt(np.average((place - mean) ** 2, weights=weight) + step**2 / 12.0))


def scatters_too_much(fit: JointFit) -> bool:
    """Whether the arm seems to scatter more than any arm does about a pose it returns to."""
    return fit.noise.flange_m > _REPEATABLE_M or fit.noise.flange_rad > _REPEATABLE_RAD


def _made(
    scatter: _Scatter,
    views: Views,
    numbers: tuple[float, float, float],
    sigmas: tuple[float, float],
) -> Present:
    length, share, size = numbers
    alike = likeness(scatter.places, scatter.places, length)
    _, weights = scatter.judged(alike, share, size)
    rms_sigma = scatter.rms_sigma(alike, share, size, weights)
    return present_field(over(views), scatter.places, weights, length, share, (*sigmas, *rms_sigma))


def made_anew(fit: JointFit, views: Views, known: Present) -> Present:
    """The field of the same length scale and share for other frames, from a fit without it."""
    given = known.as_mapping()
    numbers = (given["length_scale"], given["share"], 1.0)
    sigmas = (given["length_scale_sigma"], given["share_sigma"])
    return _made(_Scatter(fit, views), views, numbers, sigmas)


def is_arm_field(present: Present) -> bool:
    """Whether an effect is such a field."""
    return present.effect.law is not None and present.effect.law.startswith(FIELD)


def refitted(fitter: Fitter, fit: JointFit) -> JointFit:
    """Fit a cell; a field of the arm that it has is then one of the fitter's frames and this fit.

    Without such a field the fit is returned as it is.
    """
    known = next((p for p in fit.model.effects if is_arm_field(p)), None)
    if known is None:
        return fit
    rest = tuple(p for p in fit.model.effects if not is_arm_field(p))
    bare = fitter.fit(fit.model.with_effects(rest), fit.noise, fit.own_error)
    field = made_anew(bare, fitter.views, known)
    return fitter.with_effects(bare, (*rest, field))


@dataclass(frozen=True)
class _Beside:
    """A cell, the field of the arm that its errors demand, and the criterion with both."""

    fit: JointFit
    field: ArmField | None
    criterion: float


def _beside(search: Search, fit: JointFit) -> _Beside:
    """What a field of the arm adds to a fit, at the price of its three numbers."""
    found = find_arm_field(fit, search.views)
    price = _NUMBERS * float(np.log(pose_numbers(search.views)))
    gain = 0.0 if found is None else max(found.gain - price, 0.0)
    return _Beside(fit, found, search.criterion_of(fit) - gain)


def _shown_by_poses(present: Present) -> bool:
    """Whether only poses show it, so that a field of the arm might explain it as well."""
    if present.effect.name == UNNAMED:
        return present.effect.link in _POSE_LINKS
    return not present.effect.seen_without_robot and bool(present.free)


def _instead_of_effects(search: Search) -> _Beside:
    """The cell and field of the lowest criterion, names and laws that only poses show left out.

    All of them at once, or one after the other as long as that lowers the criterion: on a real arm
    each takes a share of the one field that all of them stand in for.
    """
    fit = search.best.fit
    best = _beside(search, fit)
    doubtful = [p for p in fit.model.effects if _shown_by_poses(p)]
    if not doubtful:
        return best
    none = _beside(search, _without(search, fit, doubtful))
    if best.field is None and none.field is None:
        return best
    while doubtful:
        tries = [(_beside(search, _without(search, best.fit, [p])), p) for p in doubtful]
        shorter, left_out = min(tries, key=lambda one: one[0].criterion)
        if shorter.criterion > best.criterion:
            break
        best = shorter
        doubtful = [p for p in doubtful if p.effect.label != left_out.effect.label]
    return min(best, none, key=lambda one: one.criterion)


def _without(search: Search, fit: JointFit, left_out: Sequence[Present]) -> JointFit:
    labels = {p.effect.label for p in left_out}
    rest = tuple(p for p in fit.model.effects if p.effect.label not in labels)
    return search.fitter.with_effects(fit, rest)


def with_arm_field(search: Search) -> list[Cell]:
    """Put a field of the arm into the cell where its errors demand one; its cell.

    Names and laws that only poses show give way to a field that explains more for its price:
    errors that are alike in poses near to each other follow, by chance, many a covariate for a
    while.
    """
    if not search.fitter.has_robot:
        return []
    best = _instead_of_effects(search)
    found = best.field
    if found is None:
        return []
    search.go_on_without_others(best.fit)
    fit = search.best.fit
    search.go_on_from(search.fitter.with_effects(fit, (*fit.model.effects, found.present)))
    p_value = chi2_tail(found.gain, _NUMBERS)
    length = found.present.as_mapping()["length_scale"]
    return [
        Cell(
            site="flange_pose",
            link="arm",
            covariate=over(search.views),
            score=Score(found.gain, _NUMBERS, p_value, np.zeros(0)),
            tried=1,
            curve=None,
            where=f"everywhere, alike within about {length:.2g} rad",
            law=found.present,
        )
    ]
