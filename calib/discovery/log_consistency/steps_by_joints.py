"""Tool or base frame changed during the run, seen where joints were logged beside the poses.

The poses that follow from the joints know of no tool and no user frame. Between them and the logged
poses stands one transform, of any size, and another one from the frame on where it was set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.chain import rigid
from calib.chain.kinematics import arm
from calib.discovery.log_consistency.frame_steps import (
    Side,
    frame_step,
    mended_poses,
    typical_change,
)
from calib.discovery.log_consistency.mixup import Mixup
from calib.views import FloatArray, Views

_FEWEST = 4
_SUSPECT = 1e-3
"""Metres plus radians by which logged poses depart from one transform in the mean: rounding of a
log makes a third of it, and a controller's own calibration is no step."""

_BETTER = 0.35


@dataclass(frozen=True)
class _Split:
    side: Side
    at: int
    before: FloatArray
    after: FloatArray
    miss: float


def find_step_by_joints(views: Views) -> Mixup | None:
    """Name the frame from which on poses and joints differ by another transform.

    Parameters
    ----------
    views:
        The log, its joints in radians and of the right signs.
    """
    known = np.flatnonzero(views.has_pose & np.isfinite(views.joints_rad).all(axis=1))
    if views.robot_model is None or len(known) < 2 * _FEWEST:
        return None
    poses = views.base_from_flange[known]
    forward = arm(views.robot_model).forward(views.joints_rad[known])
    between: dict[Side, FloatArray] = {
        "tool": rigid.inverse(forward) @ poses,
        "base": poses @ rigid.inverse(forward),
    }
    whole = min(float(_misses(every).mean()) for every in between.values())
    if whole < _SUSPECT:
        return None
    splits = [_split(every, side, at) for side, every in between.items() for at in _places(poses)]
    best = min(splits, key=lambda split: split.miss)
    if best.miss > _BETTER * whole:
        return None
    change = (
        rigid.inverse(best.after) @ best.before
        if best.side == "tool"
        else best.before @ rigid.inverse(best.after)
    )
    frame = int(views.frame[known[best.at]])

    def mend(some: Views, neighbours: Views) -> Views:
        late = np.asarray(some.frame >= frame)
        mended = mended_poses(some.base_from_flange, late, best.side, change)
        return replace(some, base_from_flange=mended)

    return replace(
        frame_step(best.side, frame, change, mend, ((whole, whole), (best.miss, best.miss))),
        alike=(),
        apart="",
    )


def _places(poses: FloatArray) -> range:
    return range(_FEWEST, len(poses) - _FEWEST + 1)


def _misses(between: FloatArray) -> FloatArray:
    """(N,) metres plus radians from the typical transform."""
    away = rigid.to_vector(rigid.inverse(typical_change(between)) @ between)
    return np.asarray(np.linalg.norm(away[:, :3], axis=1) + np.linalg.norm(away[:, 3:], axis=1))


def _split(between: FloatArray, side: Side, at: int) -> _Split:
    first, second = between[:at], between[at:]
    miss = float(np.concatenate([_misses(first), _misses(second)]).mean())
    return _Split(side, at, typical_change(first), typical_change(second), miss)
