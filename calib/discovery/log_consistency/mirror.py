"""Pictures that are mirrored left to right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.discovery.log_consistency.consistency import close_loop
from calib.discovery.log_consistency.mixup import Mixup
from calib.views import FloatArray, Views

_SUSPECT_M = 0.01
"""Turns agree with mirrored pictures as well; places do not."""

_BETTER = 0.2
_MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


def find_mirror(views: Views, loop: FloatArray) -> Mixup | None:
    """Name pictures that are mirrored left to right, by the loop that only then closes.

    Parameters
    ----------
    views, loop:
        The log, and (N, 4, 4) mounted_from_fixed of the free poses.
    """
    logged = close_loop(loop, views.base_from_flange, free_length=False)
    if logged is None or logged.typical_distance_m < _SUSPECT_M:
        return None
    mirrored = close_loop(_MIRROR @ loop @ _MIRROR, views.base_from_flange, free_length=False)
    if mirrored is None or mirrored.typical_distance_m > _BETTER * logged.typical_distance_m:
        return None

    def mend(some: Views, neighbours: Views) -> Views:
        corners = some.corners_px.copy()
        corners[..., 0] = some.width_px - 1.0 - corners[..., 0]
        return replace(some, corners_px=corners)

    return Mixup(
        name="mirrored_pictures",
        physics="The pictures are mirrored left to right: only so do they agree with the robot.",
        remedy=(
            "Switch the camera's or the grabber's mirroring (ReverseX) off. Corners are predicted"
            " as unmirrored pictures show them."
        ),
        mend=mend,
        evidence=(
            (logged.typical_angle_rad, logged.typical_distance_m),
            (mirrored.typical_angle_rad, mirrored.typical_distance_m),
        ),
    )
