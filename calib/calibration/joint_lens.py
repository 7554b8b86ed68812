"""Which further distortion terms the pictures deserve, and the joint fit with them.

Decentering (p1, p2), the third radial term (k3), the rational terms (k4 to k6), the thin prism
(s1 to s4) and the sensor's tilt are freed one group after the other, as long as the Bayesian
information criterion (Schwarz 1978) says so. The pictures alone decide, with a free pose for each
frame: an arm that is off must not bend the lens.
"""

from __future__ import annotations

import numpy as np

from calib.chain.model import evaluate
from calib.chain.optics import COLUMN
from calib.solver.free_poses import FreePoseFit, fit_free_poses
from calib.solver.joint import JointFit, fit_joint
from calib.solver.unknowns import PLAIN_OPTICS, unknowns_of
from calib.views import BoolArray, FloatArray, Views

FURTHER: dict[tuple[str, ...], str | None] = {
    ("p1", "p2"): None,
    ("k3",): None,
    ("k4", "k5", "k6"): None,
    ("s1", "s2", "s3", "s4"): "p1",
    ("tilt_x_rad", "tilt_y_rad"): "p1",
}
"""Terms that are freed together, and the term without which they are not asked for: prism and tilt
look much like decentering, which every other program has."""

COMMON = (("p1", "p2"), ("k3",))
"""Terms that nearly every other program has."""

_WORTH = 1.1
"""Share by which the held-out square sum must fall for terms that few other programs can say."""

_FOLDS = 5
_PATIENCE = 30
"""Iterations after which the pictures do not fix the terms asked for: a good fit takes ten."""

FURTHER_NAMES = tuple(name for group in FURTHER for name in group)


class _Pictures:
    """The pictures of a joint fit, each with a free pose, and what a choice of terms costs them."""

    def __init__(self, joint: JointFit, views: Views) -> None:
        self.state = evaluate(joint.model, views, flange_error=joint.flange_error)
        self.corners_px, self.weight = views.corners_px, joint.weight
        self.observations = 2.0 * float((joint.weight > 0.0).sum())

    def fit(self, terms: tuple[str, ...]) -> FreePoseFit:
        """All frames."""
        return self._fit(self.state.optics, slice(None), PLAIN_OPTICS + terms)

    def gain(self, without: float, with_: float, group: tuple[str, ...]) -> float:
        """By how much a group lowers the criterion; the two are weighted square sums."""
        return float(
            self.observations * np.log(without / with_) - len(group) * np.log(self.observations)
        )

    def square_sum(self, fit: FreePoseFit) -> float:
        """Weighted square sum of a fit to all frames."""
        return float(np.nansum(self.weight * np.sum(fit.residual_px**2, axis=2)))

    def held_out(self, terms: tuple[str, ...]) -> float:
        """Weighted square sum of frames that had no say in the lens, only in their own pose."""
        fold = np.arange(len(self.weight)) % _FOLDS
        total = 0.0
        for k in range(_FOLDS):
            lens = self._fit(self.state.optics, fold != k, PLAIN_OPTICS + terms)
            if not lens.converged:
                return np.inf
            optics = self.state.optics.copy()
            columns = [COLUMN[name] for name in PLAIN_OPTICS + terms]
            optics[:, columns] += lens.optics[0, columns] - self.state.optics[fold != k][0, columns]
            alone = self._fit(optics, fold == k, ())
            square = np.sum(alone.residual_px**2, axis=2)
            total += float(np.nansum(self.weight[fold == k] * square))
        return total

    def _fit(
        self, optics: FloatArray, frames: BoolArray | slice, free: tuple[str, ...]
    ) -> FreePoseFit:
        return fit_free_poses(
            optics[frames],
            self.state.camera_from_board[frames],
            self.state.points_m,
            self.corners_px[frames],
            free,
            weight=self.weight[frames],
            max_iterations=_PATIENCE,
        )


def deserved_terms(joint: JointFit, views: Views) -> tuple[str, ...]:
    """The groups that lower the Bayesian information criterion, the most informative first.

    A group that other programs rarely have must earn its price in frames held out, and a tenth of
    their square sum: on recordings at hand the criterion alone bought terms of absurd size, since
    what is wrong with a board or with the detection of its corners is no independent noise.
    """
    pictures = _Pictures(joint, views)
    terms: tuple[str, ...] = ()
    best = pictures.fit(terms)
    while True:
        before = pictures.square_sum(best)
        gains = []
        for group, after in FURTHER.items():
            if group[0] in terms or (after is not None and after not in terms):
                continue
            fit = pictures.fit(terms + group)
            gain = pictures.gain(before, pictures.square_sum(fit), group)
            if fit.converged and gain > 0.0:
                gains.append((gain, group, fit))
        for _, group, fit in sorted(gains, key=lambda one: one[0], reverse=True):
            if group in COMMON or (_sane(fit, views) and _predicts(pictures, terms, group)):
                terms, best = terms + group, fit
                break
        else:
            return _without_idle(pictures, terms, best)


def _predicts(pictures: _Pictures, terms: tuple[str, ...], group: tuple[str, ...]) -> bool:
    if len(pictures.weight) < 2 * _FOLDS:
        return False
    before, after = pictures.held_out(terms), pictures.held_out(terms + group)
    if not np.isfinite(before + after):
        return False
    return before > _WORTH * after and pictures.gain(before, after, group) > 0.0


def _without_idle(
    pictures: _Pictures, terms: tuple[str, ...], best: FreePoseFit
) -> tuple[str, ...]:
    """The terms but for those that a later group left nothing to do for."""
    for group in FURTHER:
        rest = tuple(name for name in terms if name not in group)
        if len(rest) in (0, len(terms)):
            continue
        fit = pictures.fit(rest)
        gain = pictures.gain(pictures.square_sum(fit), pictures.square_sum(best), group)
        if fit.converged and gain < 0.0:
            terms, best = rest, fit
    return terms


def _sane(fit: FreePoseFit, views: Views) -> bool:
    """Whether the distortion still grows outwards all the way to where corners were seen."""
    row, camera = fit.optics[0], fit.camera_from_board
    seen = views.board.corners_m @ np.swapaxes(camera[:, :3, :3], 1, 2) + camera[:, None, :3, 3]
    farthest = float(np.nanmax(np.linalg.norm(seen[..., :2] / seen[..., 2:], axis=-1)))
    r = np.linspace(0.0, farthest, 50)
    k1, k2, k3, k4, k5, k6 = (row[COLUMN[f"k{i}"]] for i in range(1, 7))
    below = 1.0 + k4 * r**2 + k5 * r**4 + k6 * r**6
    out = r * (1.0 + k1 * r**2 + k2 * r**4 + k3 * r**6) / below
    return bool((below > 0.0).all() and (np.diff(out) > 0.0).all())


def with_deserved_terms(joint: JointFit, views: Views) -> JointFit:
    """The joint fit with those terms free, or as it was where there are none."""
    terms = deserved_terms(joint, views)
    if not terms:
        return joint
    unknowns = unknowns_of(joint.model, PLAIN_OPTICS + terms)
    return fit_joint(joint.model, views, unknowns, joint.noise, own_error=joint.own_error)
