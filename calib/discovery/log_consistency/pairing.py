"""Pairing: pictures of another frame's pose, found frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.discovery.log_consistency.mispairing import mispaired
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_consistency.odd_frames import OddFrames
from calib.views import BoolArray, FloatArray, Views

_MOST_ODD_SHARE = 0.1

_MOST_RUN_SHARE = 0.3
_SOUND = 3

_SURE = 4.0
"""Two odd frames that fit each other's poses best vouch for one another, and so does a pose that
no other comes near: so much more may miss."""

_STANDS_OUT = 5.0


@dataclass(frozen=True)
class Pairing:
    """Whose poses the pictures are of.

    Attributes
    ----------
    mixups:
        What was mixed up, in the order in which it is to be mended.
    dropped:
        Frame numbers to leave out: their picture is of no pose in the log.
    """

    mixups: tuple[Mixup, ...]
    dropped: tuple[int, ...]


def find_pairing(views: Views, log: Views, loop: FloatArray, found: OddFrames | None) -> Pairing:
    """Name the pictures that are of another frame's pose, and those that are of nobody's.

    Parameters
    ----------
    views, log:
        The frames, and every row of the log that is known (held-out frames too).
    loop:
        (N, 4, 4) mounted_from_fixed of the free poses.
    found:
        The frames that do not fit their own row.
    """
    if found is None or not found.odd.any():
        return Pairing((), ())
    odd = found.odd
    source = _sources(views, log, loop, found)
    lost = [int(i) for i in np.flatnonzero(odd & (source < 0))]
    alone = [i for i in lost if not _beside(lost, i)]
    few = len(alone) <= max(1, _MOST_ODD_SHARE * len(views))
    left_out = sorted([*(alone if few else []), *_passing(lost, odd)])
    dropped = tuple(int(views.frame[i]) for i in left_out)
    reported = {
        int(views.frame[i]): int(log.frame[source[i]]) for i in np.flatnonzero(odd & (source >= 0))
    }
    miss = (found.closure.typical_angle_rad, found.closure.typical_distance_m)
    paired = views.take(np.flatnonzero(~odd | (source >= 0)))
    return Pairing(mispaired(paired, reported, miss), dropped)


def _beside(lost: list[int], i: int) -> bool:
    """A run of odd frames is no mix-up of single rows."""
    return i - 1 in lost or i + 1 in lost


def _passing(lost: list[int], odd: BoolArray) -> list[int]:
    """Runs of odd frames with sound ones on both sides: what moved there did not stay there."""
    runs: list[list[int]] = []
    for i in lost:
        if runs and runs[-1][-1] == i - 1:
            runs[-1].append(i)
        elif _beside(lost, i):
            runs.append([i])
    longest = _MOST_RUN_SHARE * len(odd)
    return [i for run in runs if len(run) <= longest and _sound_around(run, odd) for i in run]


def _sound_around(run: list[int], odd: BoolArray) -> bool:
    before, after = odd[: run[0]][-_SOUND:], odd[run[-1] + 1 :][:_SOUND]
    return bool(min(len(before), len(after)) == _SOUND and not before.any() and not after.any())


def _sources(views: Views, log: Views, loop: FloatArray, found: OddFrames) -> NDArray[np.int64]:
    """(N,) the row of the log whose pose each odd picture is of; -1 where there is none."""
    own = {int(frame): k for k, frame in enumerate(log.frame)}
    expected = found.closure.expected(loop)
    rows = np.flatnonzero(found.odd)
    miss = {int(i): found.miss(expected[i], log.base_from_flange) for i in rows}
    best = {i: int(each.argmin()) for i, each in miss.items()}
    by_row = {own[int(views.frame[i])]: i for i in best}
    source = np.full(len(views), -1)
    for i, row in best.items():
        other = by_row.get(row)
        mutual = other is not None and best[other] == own[int(views.frame[i])]
        sure = mutual or _stands_out(miss[i], row)
        if row != own[int(views.frame[i])] and miss[i][row] < (_SURE if sure else 1.0):
            source[i] = _nearest(miss[i], own[int(views.frame[i])], row)
    return source


def _stands_out(miss: FloatArray, row: int) -> bool:
    """Whether every other pose lies several times farther off."""
    return bool(np.delete(miss, row).min(initial=np.inf) > _STANDS_OUT * miss[row])


def _nearest(miss: FloatArray, own: int, best: int) -> int:
    """Of the rows that fit as well as the best, the one nearest in the log."""
    alike = np.flatnonzero(miss <= max(1.0, miss[best]))
    return int(alike[np.abs(alike - own).argmin()])
