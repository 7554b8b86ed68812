"""The wrong arm: another model's kinematics close the loop with the logged joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.kinematics import MODELS, arm
from calib.discovery.log_consistency.consistency import close_loop
from calib.discovery.log_consistency.mixup import Mixup
from calib.views import FloatArray, Views

_BETTER = 0.35
_SUSPECT_M = 5e-4


def find_robot_model(views: Views, loop: FloatArray) -> Mixup | None:
    """Find whether the logged joints, run through another model, fit better than the logged poses.

    Parameters
    ----------
    views, loop:
        The log, and (N, 4, 4) mounted_from_fixed of the free poses.
    """
    logged = close_loop(loop, views.base_from_flange, free_length=False)
    if logged is None or not np.isfinite(views.joints_rad).any():
        return None
    if logged.typical_distance_m < _SUSPECT_M:
        return None
    tried = {}
    for name in MODELS:
        closure = close_loop(loop, arm(name).forward(views.joints_rad), free_length=False)
        if closure is not None:
            tried[name] = closure
    if not tried:
        return None
    best = min(tried, key=lambda name: tried[name].typical_distance_m)
    if tried[best].typical_distance_m > _BETTER * logged.typical_distance_m:
        return None

    def mend(some: Views, neighbours: Views) -> Views:
        poses = arm(best).forward(some.joints_rad)
        known = np.asarray(np.isfinite(poses).all(axis=(1, 2)))[:, None, None]
        return replace(
            some,
            base_from_flange=np.where(known, poses, some.base_from_flange),
            robot_model=best,
        )

    return Mixup(
        name="robot_model",
        physics=f"The arm is a {best}: its kinematics fit the joints, the logged poses do not.",
        remedy=f"Say {best} in the recording, and log the poses of the arm that is really there.",
        mend=mend,
        evidence=(
            (logged.typical_angle_rad, logged.typical_distance_m),
            (tried[best].typical_angle_rad, tried[best].typical_distance_m),
        ),
    )
