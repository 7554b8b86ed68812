"""Tool or base frame of the controller changed during the run: from one frame on poses differ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain import rigid
from calib.discovery.log_consistency.consistency import Closure, close_loop
from calib.discovery.log_consistency.mixup import Mixup
from calib.views import BoolArray, FloatArray, Views

Side = Literal["tool", "base"]

_SUSPECT = 3e-3
"""Metres plus radians by which the loop must miss in the median before steps are tried."""

_BETTER = 0.1
_LEAST_M, _LEAST_RAD = 0.02, 0.08
"""Smaller steps are something that moved, and the search names them."""

_FEWEST = 5
_WORDS = {"tool": "tool frame (TCP)", "base": "base or user frame"}
_ALIKE = {"tool": "what is mounted on the flange", "base": "what stands fixed in the cell"}


@dataclass(frozen=True)
class _Step:
    """Poses of the frames from place `at` on, times `change` on that side, agree with the rest."""

    side: Side
    at: int
    change: FloatArray
    miss: float


def find_frame_step(views: Views, loop: FloatArray) -> Mixup | None:
    """Name the frame from which on the poses are of another tool or base frame.

    Parameters
    ----------
    views, loop:
        The log, and (N, 4, 4) mounted_from_fixed of the free poses.
    """
    logged = close_loop(loop, views.base_from_flange, free_length=False)
    if logged is None or _miss(logged) < _SUSPECT:
        return None
    poses = views.base_from_flange
    steps = [
        step
        for at in range(_FEWEST, len(views) - _FEWEST + 1)
        for step in _steps_at(loop, poses, at)
    ]
    if not steps:
        return None
    best = min(steps, key=lambda step: step.miss)
    size = rigid.to_vector(best.change)
    small = np.linalg.norm(size[:3]) < _LEAST_M and np.linalg.norm(size[3:]) < _LEAST_RAD
    if small or best.miss > _BETTER * _mean_miss(logged):
        return None
    return _mixup(best, int(views.frame[best.at]), logged)


def _steps_at(loop: FloatArray, poses: FloatArray, at: int) -> list[_Step]:
    """Both kinds of step at one place, seen from the longer side."""
    late = np.arange(len(loop)) >= at
    longer = late if late.sum() > len(late) / 2 else ~late
    closure = close_loop(loop, np.where(longer[:, None, None], poses, np.nan), free_length=False)
    if closure is None:
        return []
    expected = closure.expected(loop)
    changes: dict[Side, FloatArray] = {
        "tool": rigid.inverse(poses) @ expected,
        "base": expected @ rigid.inverse(poses),
    }
    found = []
    for side, every in changes.items():
        known = ~longer & np.isfinite(every).all(axis=(1, 2))
        if known.sum() < _FEWEST - 1:
            continue
        change = typical_change(every[known])
        change = change if longer is not late else rigid.inverse(change)
        mended = mended_poses(poses, late, side, change)
        if longer is late:
            # the longer side judges by its own poses: the reference is the part before the step
            reference = _in_reference(closure, side, change)
            judged = reference.judging(loop, mended)
        else:
            judged = closure.judging(loop, mended)
        found.append(_Step(side, at, change, _mean_miss(judged)))
    return found


def _in_reference(closure: Closure, side: Side, change: FloatArray) -> Closure:
    """The loop of poses that were changed on that side, from the loop of those that were not."""
    if side == "tool":
        mounted = rigid.inverse(change) @ closure.flange_from_mounted
        return replace(closure, flange_from_mounted=mounted)
    return replace(closure, base_from_fixed=change @ closure.base_from_fixed)


def mended_poses(poses: FloatArray, late: BoolArray, side: Side, change: FloatArray) -> FloatArray:
    """(N, 4, 4) with the `late` poses changed on that side."""
    changed = poses @ change if side == "tool" else change @ poses
    return np.where(late[:, None, None], changed, poses)


def typical_change(changes: FloatArray) -> FloatArray:
    """(4, 4) of (N, 4, 4): the median place, and the mean turn of those near it."""
    out = np.eye(4)
    turns = Rotation.from_matrix(changes[:, :3, :3])
    apart = [float(np.median((turns[k].inv() * turns).magnitude())) for k in range(len(changes))]
    middle = turns[int(np.argmin(apart))]
    near = np.atleast_1d((middle.inv() * turns).magnitude() <= 3.0 * min(apart) + 1e-6)
    out[:3, :3] = turns[near].mean().as_matrix()
    out[:3, 3] = np.median(changes[near, :3, 3], axis=0)
    return out


def _miss(closure: Closure) -> float:
    return closure.typical_distance_m + closure.typical_angle_rad


def _mean_miss(closure: Closure) -> float:
    return float(np.nanmean(closure.distance_m) + np.nanmean(closure.angle_rad))


def _mixup(step: _Step, frame: int, logged: Closure) -> Mixup:
    def mend(some: Views, neighbours: Views) -> Views:
        late = np.asarray(some.frame >= frame)
        mended = mended_poses(some.base_from_flange, late, step.side, step.change)
        return replace(some, base_from_flange=mended)

    before = (logged.typical_angle_rad, logged.typical_distance_m)
    found = frame_step(step.side, frame, step.change, mend, (before, (step.miss, step.miss)))
    return replace(found, physics=f"{found.physics[:-1]}; or {_ALIKE[step.side]} was moved.")


def frame_step(
    side: Side,
    frame: int,
    change: FloatArray,
    mend: Callable[[Views, Views], Views],
    evidence: tuple[tuple[float, float], tuple[float, float]],
) -> Mixup:
    """The mix-up of a tool or base frame that was set anew.

    Parameters
    ----------
    side, frame, change:
        Poses from that frame on, times `change` (4, 4) on that side, agree with the rest.
    mend, evidence:
        As in `Mixup`.
    """
    size = rigid.to_vector(change)
    names = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")
    far, turn = float(np.linalg.norm(size[:3])), float(np.rad2deg(np.linalg.norm(size[3:])))
    return Mixup(
        name=f"{side}_frame_step",
        physics=(
            f"From frame {frame} on the poses are of another {_WORDS[side]}, {far * 1e3:.1f} mm"
            f" and {turn:.1f} degrees from the one before."
        ),
        remedy="Set tool and user frame once, before the run; log the flange and no tool.",
        mend=mend,
        parameters={
            "at_frame": (float(frame), "frame"),
            **{n: (float(v), n.rsplit("_", 1)[1]) for n, v in zip(names, size, strict=True)},
        },
        alike=("mount_slip" if side == "tool" else "board_slip",),
        apart="the controller's settings and the cell itself: what was moved leaves a mark there",
        evidence=evidence,
    )
