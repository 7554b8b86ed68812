"""Pairing: frames that carry their neighbour's pose, or each other's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.chain import rigid
from calib.discovery.log_consistency.consistency import Closure, close_loop
from calib.discovery.log_consistency.mixup import ROBOT_COLUMNS, Mixup
from calib.views import BoolArray, FloatArray, Views

_SHIFTS = (-3, -2, -1, 1, 2, 3)
_BETTER = 0.2
_SUSPECT_RAD = 0.02
_FAR = 12.0
"""A frame this many times farther off than the median frame carries a wrong pose."""
_MATCH = 5.0
_MOST_ODD_SHARE = 0.1


def _rows_from(views: Views, log: Views, index: FloatArray) -> Views:
    """Views whose robot columns come from rows `index` of `log`; NaN where index is NaN."""
    known = np.isfinite(index)
    row = np.where(known, index, 0).astype(np.int64)
    columns = {}
    for name in ROBOT_COLUMNS:
        value = np.full_like(getattr(views, name), np.nan)
        value[known] = getattr(log, name)[row[known]]
        columns[name] = value
    return replace(views, **columns)


def shifted(views: Views, log: Views, shift: int) -> Views:
    """The views with each frame's robot row taken `shift` frames later in the log."""
    where = {int(frame): k for k, frame in enumerate(log.frame)}
    index = np.array([where.get(int(f) + shift, np.nan) for f in views.frame], dtype=np.float64)
    return _rows_from(views, log, index)


def find_offset(views: Views, log: Views, loop: FloatArray) -> Mixup | None:
    """Find whether every frame is paired with a neighbour's pose.

    Parameters
    ----------
    views, log:
        The frames, and every row of the log that is known (held-out frames too).
    loop:
        (N, 4, 4) mounted_from_fixed of the free poses.
    """
    as_paired = close_loop(loop, views.base_from_flange, free_length=False)
    if as_paired is None or as_paired.typical_angle_rad < _SUSPECT_RAD:
        return None
    best: tuple[int, Closure] | None = None
    for shift in _SHIFTS:
        tried = close_loop(loop, shifted(views, log, shift).base_from_flange, free_length=False)
        if tried is None or tried.typical_angle_rad > _BETTER * as_paired.typical_angle_rad:
            continue
        if best is None or tried.typical_angle_rad < best[1].typical_angle_rad:
            best = (shift, tried)
    if best is None:
        return None
    shift, after = best

    def mend(some: Views, neighbours: Views) -> Views:
        return shifted(some, neighbours, shift)

    return Mixup(
        name="frame_pose_offset",
        physics=f"Every picture is paired with the pose logged {shift:+d} frames from its own.",
        remedy="Check when pose and picture are read; pair them by trigger, not by count.",
        mend=mend,
        parameters={"frames": (float(shift), "frame")},
        evidence=(
            (as_paired.typical_angle_rad, as_paired.typical_distance_m),
            (after.typical_angle_rad, after.typical_distance_m),
        ),
    )


_MUTUAL = 4.0
"""Two odd frames that fit each other's poses best vouch for one another: so much more may miss."""


@dataclass(frozen=True)
class OddFrames:
    """Frames whose pose cannot be theirs.

    Attributes
    ----------
    swap:
        The mixup, when some carry each other's poses.
    dropped:
        Frame numbers to leave out: their pose belongs to no frame.
    """

    swap: Mixup | None
    dropped: tuple[int, ...]


def find_odd_frames(views: Views, loop: FloatArray) -> OddFrames:
    """Name the frames that carry each other's poses, and those whose pose is nobody's."""
    closure = close_loop(loop, views.base_from_flange, free_length=False)
    if closure is None:
        return OddFrames(None, ())
    odd = _odd(closure)
    if not odd.any():
        return OddFrames(None, ())
    index = np.arange(len(views), dtype=np.float64)
    expected = _expected(closure, loop)
    rows = np.flatnonzero(odd)
    miss = np.array([_miss(expected[i], views.base_from_flange[rows], closure) for i in rows])
    best = miss.argmin(axis=1)
    for k, i in enumerate(rows):
        mutual = best[best[k]] == k
        if miss[k, best[k]] < (_MUTUAL if mutual else 1.0) and best[k] != k:
            index[i] = rows[best[k]]
    exchanged = [int(i) for i in rows if index[i] != i]
    lost = [i for i in rows if index[i] == i]
    alone = [i for i in lost if not _odd_neighbour(odd, int(i))]
    few = len(alone) <= max(1, _MOST_ODD_SHARE * len(views))
    dropped = tuple(int(views.frame[i]) for i in alone) if few else ()
    return OddFrames(_swap(views, index, exchanged, closure), dropped)


def _odd_neighbour(odd: BoolArray, i: int) -> bool:
    """A run of odd frames is no mix-up in the log: something moved and stayed there."""
    return bool((i > 0 and odd[i - 1]) or odd[i + 1 : i + 2].any())


def _odd(closure: Closure) -> BoolArray:
    angle, distance = closure.angle_rad, closure.distance_m
    far = (angle > _FAR * np.nanmedian(angle)) | (distance > _FAR * np.nanmedian(distance))
    return np.asarray(far & (np.isfinite(angle)))


def _expected(closure: Closure, loop: FloatArray) -> FloatArray:
    """(N, 4, 4) base_from_flange that the pictures ask for."""
    return closure.base_from_fixed @ rigid.inverse(closure.flange_from_mounted @ loop)


def _miss(expected: FloatArray, poses: FloatArray, closure: Closure) -> FloatArray:
    """(K,) how far each pose lies from the expected one, in units of what is tolerated."""
    step = np.nan_to_num(rigid.to_vector(rigid.inverse(expected) @ poses), nan=1e9)
    angle = np.linalg.norm(step[:, 3:], axis=1) / (_MATCH * closure.typical_angle_rad + 1e-4)
    lever = _MATCH * closure.typical_distance_m + 1e-4
    return np.asarray(np.maximum(angle, np.linalg.norm(step[:, :3], axis=1) / lever))


def _swap(views: Views, index: FloatArray, exchanged: list[int], closure: Closure) -> Mixup | None:
    if not exchanged:
        return None
    source = {int(views.frame[i]): int(views.frame[int(index[i])]) for i in exchanged}

    def mend(some: Views, neighbours: Views) -> Views:
        where = {int(frame): k for k, frame in enumerate(neighbours.frame)}
        rows = [where.get(source.get(int(f), int(f)), np.nan) for f in some.frame]
        return _rows_from(some, neighbours, np.array(rows, dtype=np.float64))

    pairs = ", ".join(f"{a} carries the pose of {b}" for a, b in sorted(source.items()))
    return Mixup(
        name="frame_pose_swap",
        physics=f"Some frames carry each other's poses: {pairs}.",
        remedy="Check how pictures and poses are matched; these frames were put right in the twin.",
        mend=mend,
        parameters={"frames": (float(len(source)), "frame")},
        evidence=(
            (float(np.nanmax(closure.angle_rad)), float(np.nanmax(closure.distance_m))),
            (closure.typical_angle_rad, closure.typical_distance_m),
        ),
    )
