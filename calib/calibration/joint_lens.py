"""Which further distortion terms the pictures deserve, and the joint fit with them.

Decentering (p1, p2), the third radial term (k3), the rational terms (k4 to k6), the thin prism
(s1 to s4) and the sensor's tilt are freed one group after the other, as long as the Bayesian
information criterion (Schwarz 1978) says so. The pictures alone decide, with a free pose for each
frame: an arm that is off must not bend the lens. A wide lens has its four radial terms from
the start and no rational ones.
"""

from __future__ import annotations

import numpy as np

from calib.calibration.pictures import FOLDS, Pictures
from calib.chain.domain import invertible_rad
from calib.solver.free_poses import FreePoseFit
from calib.solver.joint import JointFit, fit_joint
from calib.solver.unknowns import plain_optics, unknowns_of
from calib.views import Views

RATIONAL = ("k4", "k5", "k6")
FURTHER: dict[tuple[str, ...], str | None] = {
    ("p1", "p2"): None,
    ("k3",): None,
    RATIONAL: None,
    ("s1", "s2", "s3", "s4"): "p1",
    ("tilt_x_rad", "tilt_y_rad"): "p1",
}
"""Terms that are freed together, and the term without which they are not asked for: prism and tilt
look much like decentering, which every other program has."""

COMMON = (("p1", "p2"), ("k3",))
"""Terms that nearly every other program has."""

WORTH = 1.1
"""Share by which the held-out square sum must fall for terms that few other programs can say."""

FURTHER_NAMES = tuple(name for group in FURTHER for name in group)


def deserved_terms(pictures: Pictures) -> tuple[str, ...]:
    """The groups that lower the Bayesian information criterion, the most informative first.

    A group that other programs rarely have must earn its price in frames held out, and a tenth of
    their square sum: on recordings at hand the criterion alone bought terms of absurd size, since
    what is wrong with a board or with the detection of its corners is no independent noise.
    """
    terms: tuple[str, ...] = ()
    best = pictures.fit(terms)
    while True:
        before = pictures.square_sum(best)
        gains = []
        for group, after in _groups(pictures).items():
            if group[0] in (*terms, *pictures.plain) or (after and after not in terms):
                continue
            fit = pictures.fit(terms + group)
            gain = pictures.gain(before, pictures.square_sum(fit), group)
            if fit.converged and gain > 0.0:
                gains.append((gain, group, fit))
        for _, group, fit in sorted(gains, key=lambda one: one[0], reverse=True):
            if group in COMMON or (_sane(fit, pictures) and _predicts(pictures, terms, group)):
                terms, best = terms + group, fit
                break
        else:
            return _without_idle(pictures, terms, best)


def _groups(pictures: Pictures) -> dict[tuple[str, ...], str | None]:
    return {g: after for g, after in FURTHER.items() if not (pictures.wide and g == RATIONAL)}


def _predicts(pictures: Pictures, terms: tuple[str, ...], group: tuple[str, ...]) -> bool:
    if len(pictures.weight) < 2 * FOLDS:
        return False
    before, after = pictures.held_out(terms), pictures.held_out(terms + group)
    if not np.isfinite(before + after):
        return False
    return before > WORTH * after and pictures.gain(before, after, group) > 0.0


def _without_idle(pictures: Pictures, terms: tuple[str, ...], best: FreePoseFit) -> tuple[str, ...]:
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


def _sane(fit: FreePoseFit, pictures: Pictures) -> bool:
    """Whether the distortion still grows outwards all the way to where corners were seen."""
    return pictures.farthest_rad(fit.camera_from_board) < invertible_rad(fit.optics[0])


def with_deserved_terms(joint: JointFit, views: Views) -> JointFit:
    """The joint fit with those terms free, or as it was where there are none."""
    terms = deserved_terms(Pictures.of_joint(joint, views))
    if not terms:
        return joint
    unknowns = unknowns_of(joint.model, plain_optics(joint.model.optics) + terms)
    return fit_joint(joint.model, views, unknowns, joint.noise, own_error=joint.own_error)
