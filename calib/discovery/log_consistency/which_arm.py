"""Which arm it is, found from poses and joints of the log alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.kinematics import MODELS, arm
from calib.views import Views

_SAME = 1e-4
"""Metres, and entries of the rotation, by which a model's own poses may differ in a log."""


def recognise_arm(views: Views) -> tuple[Views, str | None]:
    """Name the arm whose nominal kinematics give the logged poses, where none was named.

    Returns
    -------
    The views, their model filled in where it was not known, and a sentence about it or None.
    """
    if views.robot_model is not None or not np.isfinite(views.joints_rad).any():
        return views, None
    both = views.has_pose & np.isfinite(views.joints_rad).all(axis=1)
    if not both.any() or views.joints_rad.shape[1] != 6:
        return views, None
    for name in MODELS:
        miss = arm(name).forward(views.joints_rad[both]) - views.base_from_flange[both]
        if np.abs(miss).max() < _SAME:
            return replace(views, robot_model=name), f"the logged joints and poses are a {name}'s"
    return views, None
