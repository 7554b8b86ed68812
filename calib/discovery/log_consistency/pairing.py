"""Pairing: pictures of another frame's pose, found frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.chain import rigid
from calib.discovery.log_consistency.consistency import Closure
from calib.discovery.log_consistency.mispairing import mispaired
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_consistency.trusted import Trusted, trusted_loop
from calib.views import BoolArray, FloatArray, Views

_FAR = 12.0
"""A frame this many times farther off than the median frame carries a wrong pose."""

_MATCH = 5.0
_MOST_ODD_SHARE = 0.1

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


def find_pairing(views: Views, log: Views, loop: FloatArray) -> Pairing:
    """Name the pictures that are of another frame's pose, and those that are of nobody's.

    Parameters
    ----------
    views, log:
        The frames, and every row of the log that is known (held-out frames too).
    loop:
        (N, 4, 4) mounted_from_fixed of the free poses.
    """
    trusted = trusted_loop(views, log, loop)
    if trusted is None:
        return Pairing((), ())
    odd = _odd(trusted)
    if not odd.any():
        return Pairing((), ())
    source = _sources(views, log, loop, trusted.closure, odd)
    lost = [int(i) for i in np.flatnonzero(odd & (source < 0))]
    alone = [i for i in lost if not _beside(lost, i)]
    few = len(alone) <= max(1, _MOST_ODD_SHARE * len(views))
    dropped = tuple(int(views.frame[i]) for i in alone) if few else ()
    told = {
        int(views.frame[i]): int(log.frame[source[i]]) for i in np.flatnonzero(odd & (source >= 0))
    }
    miss = (trusted.closure.typical_angle_rad, trusted.closure.typical_distance_m)
    paired = views.take(np.flatnonzero(~odd | (source >= 0)))
    return Pairing(mispaired(paired, told, miss), dropped)


def _beside(lost: list[int], i: int) -> bool:
    """A run of odd frames is no mix-up of single rows: something moved and stayed there."""
    return i - 1 in lost or i + 1 in lost


def _odd(trusted: Trusted) -> BoolArray:
    angle, distance = trusted.as_logged.angle_rad, trusted.as_logged.distance_m
    far = (angle > _FAR * trusted.closure.typical_angle_rad) | (
        distance > _FAR * trusted.closure.typical_distance_m
    )
    return np.asarray(far & np.isfinite(angle))


def _sources(
    views: Views, log: Views, loop: FloatArray, closure: Closure, odd: BoolArray
) -> NDArray[np.int64]:
    """(N,) the row of the log whose pose each odd picture is of; -1 where there is none."""
    own = {int(frame): k for k, frame in enumerate(log.frame)}
    expected = closure.expected(loop)
    rows = np.flatnonzero(odd)
    miss = {int(i): _miss(expected[i], log.base_from_flange, closure) for i in rows}
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


def _miss(expected: FloatArray, poses: FloatArray, closure: Closure) -> FloatArray:
    """(K,) how far each pose lies from the expected one, in units of what is tolerated."""
    step = np.nan_to_num(rigid.to_vector(rigid.inverse(expected) @ poses), nan=1e9)
    angle = np.linalg.norm(step[:, 3:], axis=1) / (_MATCH * closure.typical_angle_rad + 1e-4)
    lever = _MATCH * closure.typical_distance_m + 1e-4
    return np.asarray(np.maximum(angle, np.linalg.norm(step[:, :3], axis=1) / lever))
