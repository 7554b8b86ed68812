"""Frames whose picture and pose do not belong together, judged by those that do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain import rigid
from calib.discovery.log_consistency.consistency import Closure, mounted_from_fixed
from calib.discovery.log_consistency.trusted import Trusted, trusted_loop
from calib.views import BoolArray, FloatArray, Views

_FAR = 12.0
"""A frame this many times farther off than the median frame carries a wrong pose."""

_MATCH = 5.0
"""A pose within so many times the median belongs to the picture."""

READ_OTHERWISE = 4.0
"""What an odd frame may miss, read otherwise: there are few other readings to fit by chance."""


@dataclass(frozen=True)
class OddFrames:
    """The frames that are off.

    Attributes
    ----------
    odd:
        (N,) which.
    closure:
        The loop by the frames that agree.
    """

    odd: BoolArray
    closure: Closure

    def fitting(self, views: Views, camera_from_board: FloatArray) -> list[int]:
        """The odd frames whose own pose would fit if their free poses were these."""
        loop = mounted_from_fixed(camera_from_board, views.mount)
        expected = self.closure.expected(loop)
        return [
            int(i)
            for i in np.flatnonzero(self.odd)
            if self.miss(expected[i], views.base_from_flange[[i]])[0] < READ_OTHERWISE
        ]

    def miss(self, expected: FloatArray, poses: FloatArray) -> FloatArray:
        """(K,) how far poses lie from the expected one, in units of what is tolerated."""
        step = np.nan_to_num(rigid.to_vector(rigid.inverse(expected) @ poses), nan=1e9)
        angle = _MATCH * self.closure.typical_angle_rad + 1e-4
        lever = _MATCH * self.closure.typical_distance_m + 1e-4
        turned, moved = np.linalg.norm(step[:, 3:], axis=1), np.linalg.norm(step[:, :3], axis=1)
        return np.asarray(np.maximum(turned / angle, moved / lever))


def find_odd_frames(views: Views, log: Views, loop: FloatArray) -> OddFrames | None:
    """Which frames do not fit their row of the log; None where too few fit each other.

    Parameters
    ----------
    views, log:
        The frames, and every row of the log that is known (held-out frames too).
    loop:
        (N, 4, 4) mounted_from_fixed of the free poses.
    """
    trusted = trusted_loop(views, log, loop)
    return None if trusted is None else OddFrames(_odd(trusted), trusted.closure)


def _odd(trusted: Trusted) -> BoolArray:
    angle, distance = trusted.as_logged.angle_rad, trusted.as_logged.distance_m
    far = (angle > _FAR * trusted.closure.typical_angle_rad) | (
        distance > _FAR * trusted.closure.typical_distance_m
    )
    return np.asarray(far & np.isfinite(angle))
