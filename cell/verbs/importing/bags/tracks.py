"""Joints and poses over time, and their values between the samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from calib.views import FloatArray


@dataclass(frozen=True)
class Joints:
    """Joint angles over time.

    Attributes
    ----------
    times_s:
        (T,) increasing.
    angles_rad:
        (T, J).
    """

    times_s: FloatArray
    angles_rad: FloatArray

    def at(self, times_s: FloatArray) -> FloatArray:
        """(N, J) straight between the samples, the first and last held outside."""
        columns = [np.interp(times_s, self.times_s, column) for column in self.angles_rad.T]
        return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Track:
    """A pose over time.

    Attributes
    ----------
    times_s:
        (T,) increasing; empty for a pose that stands still.
    matrices:
        (T, 4, 4), or (1, 4, 4) for one that stands still.
    """

    times_s: FloatArray
    matrices: FloatArray

    @cached_property
    def _turns(self) -> Slerp:
        return Slerp(self.times_s, Rotation.from_matrix(self.matrices[:, :3, :3]))

    def at(self, times_s: FloatArray) -> FloatArray:
        """(N, 4, 4) on the straight way between the samples, the ends held outside."""
        if len(self.matrices) == 1:
            return np.repeat(self.matrices, len(times_s), axis=0)
        inside = np.clip(times_s, self.times_s[0], self.times_s[-1])
        out = np.tile(np.eye(4), (len(times_s), 1, 1))
        out[:, :3, :3] = self._turns(inside).as_matrix()
        for axis in range(3):
            out[:, axis, 3] = np.interp(inside, self.times_s, self.matrices[:, axis, 3])
        return out


def away_s(samples_s: FloatArray, times_s: FloatArray) -> FloatArray:
    """(N,) how far the farther of the two samples around each time is; infinite outside."""
    if not len(samples_s):
        return np.zeros(len(times_s))
    after = np.searchsorted(samples_s, times_s)
    low, high = np.clip(after - 1, 0, None), np.clip(after, None, len(samples_s) - 1)
    exact = samples_s[high] == times_s
    off = np.maximum(times_s - samples_s[low], samples_s[high] - times_s)
    off = np.where(exact, 0.0, off)
    outside = ~exact & ((after == 0) | (after == len(samples_s)))
    return np.asarray(np.where(outside, np.inf, off))


def sorted_once(times_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Samples in order of time, the last of those at one time."""
    order = np.argsort(times_s, kind="stable")
    times, values = times_s[order], values[order]
    last = np.append(np.diff(times) > 0, True)
    return times[last], values[last]
