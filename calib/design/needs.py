"""What a calibrated camera is needed for, as linear functions of the numbers that are fitted.

An uncertainty of each is then a quadratic form of the fit's covariance, and a set of views can be
judged before any is taken (Fedorov 1972, linear criteria; I- and A-optimality are of this kind).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.calibration.uncertainty import (
    Estimate,
    focal_length_change_px,
    grid_m,
    grid_px,
    projection_change_px,
)
from calib.views import FloatArray, Views

ALPHA_DISTANCES = 9


@dataclass(frozen=True)
class Need:
    """One thing that is needed.

    Attributes
    ----------
    name, unit:
        Of its standard error.
    change:
        (R, p) of R values by each of the p numbers; the root mean square over the values counts.
    """

    name: str
    unit: str
    change: FloatArray

    @property
    def weight(self) -> FloatArray:
        """(p, p) matrix W: the squared standard error is the trace of covariance times W."""
        return np.asarray(self.change.T @ self.change) / len(self.change)


def needs_of(
    estimate: Estimate, views: Views, distance_range_m: tuple[float, float]
) -> tuple[Need, ...]:
    """Projection over the working volume, the focal length over the distances, hand-eye.

    Parameters
    ----------
    estimate:
        Where the chain is linearised; its covariance gives the steps of the differences.
    views:
        Image size, board and mount are looked at.
    distance_range_m:
        Nearest and farthest depth of the working volume.

    Returns
    -------
    Pixels of a point that the robot has the place of, over image and distances; pixels of alpha,
    focused at distances evenly apart; the camera's place on the flange (in the base, where it
    stands still), metres and radians an axis.
    """
    p = len(estimate.unknowns)
    grid = grid_px(views, estimate.model)
    pixels = projection_change_px(estimate, views, grid, grid_m(distance_range_m))
    distances = np.linspace(*distance_range_m, ALPHA_DISTANCES)
    camera = "flange_from_mounted" if views.mount == "eye_in_hand" else "base_from_fixed"
    at = [k for k, u in enumerate(estimate.unknowns) if u.name.startswith(f"{camera}.")]
    return (
        Need("projection", "px", pixels.reshape(-1, p)),
        Need("alpha", "px", focal_length_change_px(estimate, views, distances)),
        Need("hand_eye_position", "m", np.eye(p)[at[:3]]),
        Need("hand_eye_rotation", "rad", np.eye(p)[at[3:]]),
    )
