"""Which further distortion terms the pictures deserve, and the joint fit with them.

Decentering (p1, p2 together) and the third radial term (k3) are kept where the Bayesian
information criterion (Schwarz 1978) says so. The pictures alone decide, with a free pose for each
frame: an arm that is off must not bend the lens.
"""

from __future__ import annotations

import numpy as np

from calib.chain.model import walk
from calib.chain.optics import COLUMN
from calib.solver.free_poses import fit_free_poses
from calib.solver.joint import JointFit, fit_joint
from calib.solver.unknowns import PLAIN_OPTICS, unknowns_of
from calib.views import Views

FURTHER: tuple[tuple[str, ...], ...] = (("p1", "p2"), ("k3",))
"""Terms that are freed together."""

FURTHER_NAMES = tuple(name for group in FURTHER for name in group)


def deserved_terms(joint: JointFit, views: Views) -> tuple[str, ...]:
    """The terms whose Wald statistic exceeds log(n) for each number, with all others free."""
    state = walk(joint.model, views, flange_error=joint.flange_error)
    fit = fit_free_poses(
        state.optics,
        state.camera_from_board,
        state.points_m,
        views.corners_px,
        PLAIN_OPTICS + FURTHER_NAMES,
        weight=joint.weight,
    )
    price = np.log(2.0 * float((joint.weight > 0.0).sum()))
    kept: list[str] = []
    for group in FURTHER:
        at = [len(PLAIN_OPTICS) + FURTHER_NAMES.index(name) for name in group]
        value = fit.optics[0, [COLUMN[name] for name in group]]
        wald = float(value @ np.linalg.solve(fit.covariance[np.ix_(at, at)], value))
        if fit.converged and wald > price * len(group):
            kept += group
    return tuple(kept)


def with_deserved_terms(joint: JointFit, views: Views) -> JointFit:
    """The joint fit with those terms free, or as it was where there are none."""
    terms = deserved_terms(joint, views)
    if not terms:
        return joint
    unknowns = unknowns_of(joint.model, PLAIN_OPTICS + terms)
    return fit_joint(joint.model, views, unknowns, joint.noise, flange_error=joint.flange_error)
