"""The misfit split: what a free camera pose could absorb, and what it could not.

Focus and every fault of the arm hide in the first part; only the robot's poses show them. The
second part is seen in the pictures alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.solver.joint import JointFit
from calib.solver.noise import Noise


@dataclass(frozen=True)
class Split:
    """Squared misfit in units of the noise, per degree of freedom: one where only noise is left.

    Attributes
    ----------
    pose:
        Of the six numbers of each frame that a free camera pose would absorb.
    picture:
        Of what remains in the pictures with a free pose for each frame.
    """

    pose: float
    picture: float


def split_misfit(fit: JointFit, noise: Noise) -> Split:
    """Judge a fit's flange errors and corner residuals by these noise levels."""
    error = fit.flange_error
    pose = float(np.mean((error @ noise.flange_information) * error))
    square = np.nansum(fit.residual_px**2, axis=2) * fit.weight
    freedom = 2 * int((fit.weight > 0.0).sum()) - error.size
    return Split(pose, float(square.sum()) / noise.corner_px**2 / max(freedom, 1))
