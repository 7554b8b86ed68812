"""The hand-eye loop by the frames that agree with each other, whichever rows of the log fit them.

The pairing that most frames agree on may be the logged one or that of a neighbouring row; what
the others carry is found against it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.discovery.log_consistency.consensus import TOLERANCES_RAD, agreeing, angle_misfits
from calib.discovery.log_consistency.consistency import Closure, close_loop
from calib.discovery.log_consistency.mixup import ROBOT_COLUMNS
from calib.views import BoolArray, FloatArray, Views

SHIFTS = (0, -1, 1, -2, 2, -3, 3)
_MOST = 0.5
"""The pairing that this share of the frames agrees on is beyond doubt."""

_FEWEST, _LEAST_SHARE = 5, 0.3


@dataclass(frozen=True)
class Trusted:
    """The loop by the frames that agree.

    Attributes
    ----------
    closure:
        Of those frames, which are paired with the rows `shift` frames later in the log.
    shift:
        Zero where the log pairs them rightly.
    as_logged:
        What every frame misses by with its own row of the log.
    """

    closure: Closure
    shift: int
    as_logged: Closure


def rows_from(views: Views, log: Views, index: FloatArray) -> Views:
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
    return rows_from(views, log, index)


def trusted_loop(views: Views, log: Views, loop: FloatArray) -> Trusted | None:
    """Close the loop by the frames that agree; None where too few do.

    Parameters
    ----------
    views, log:
        The frames, and every row of the log that is known (held-out frames too).
    loop:
        (N, 4, 4) mounted_from_fixed of the free poses.
    """
    poses = {shift: shifted(views, log, shift).base_from_flange for shift in SHIFTS}
    misfits = {shift: angle_misfits(loop, at) for shift, at in poses.items()}
    known = int(np.isfinite(loop).all(axis=(1, 2)).sum())
    best: tuple[int, BoolArray] = (0, np.zeros(len(views), dtype=bool))
    for tolerance in TOLERANCES_RAD:
        for shift in SHIFTS:
            agree = agreeing(misfits[shift], tolerance)
            if agree.sum() > best[1].sum():
                best = (shift, agree)
            if best[1].sum() > _MOST * known:
                return _closed(loop, poses, *best)
    if best[1].sum() < max(_FEWEST, _LEAST_SHARE * known):
        return None
    return _closed(loop, poses, *best)


def _closed(
    loop: FloatArray, poses: Mapping[int, FloatArray], shift: int, agree: BoolArray
) -> Trusted | None:
    only = np.where(agree[:, None, None], poses[shift], np.nan)
    closure = close_loop(loop, only, free_length=False)
    if closure is None:
        return None
    return Trusted(closure, shift, closure.judging(loop, poses[0]))
