"""Columns that were not logged but follow from others: joints, poses, where a move came from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.chain.kinematics import ArmKinematics, arm
from calib.views import FloatArray, Views


@dataclass(frozen=True)
class Recovered:
    """Views with what could be worked out filled in, and sentences that say what was."""

    views: Views
    notes: tuple[str, ...]


def recover_poses(views: Views) -> Recovered:
    """Fill in flange poses that were not logged from the joints that were."""
    if views.robot_model is None:
        return Recovered(views, ())
    return Recovered(*_poses_from_joints(views, arm(views.robot_model)))


def recover_joints(views: Views) -> Recovered:
    """Fill in joints from poses (mended ones), and approaches from the order of the log."""
    if np.isfinite(views.joints_rad).any():
        return Recovered(*_approaches(views))
    if views.robot_model is None:
        return Recovered(views, ())
    return Recovered(*_joints_from_poses(views, arm(views.robot_model)))


def _poses_from_joints(views: Views, kinematics: ArmKinematics) -> tuple[Views, tuple[str, ...]]:
    lacking = ~views.has_pose & np.isfinite(views.joints_rad).all(axis=1)
    if not lacking.any():
        return views, ()
    poses = views.base_from_flange.copy()
    poses[lacking] = kinematics.forward(views.joints_rad[lacking])
    note = f"flange poses of {int(lacking.sum())} frames worked out from the joints"
    return replace(views, base_from_flange=poses), (note,)


def _joints_from_poses(views: Views, kinematics: ArmKinematics) -> tuple[Views, tuple[str, ...]]:
    if np.isfinite(views.joints_rad).any() or not views.has_pose.any():
        return views, ()
    joints = np.full((len(views), 6), np.nan)
    near: FloatArray | None = None
    for i in np.flatnonzero(views.has_pose):
        branches = kinematics.inverse_all(views.base_from_flange[i])
        if len(branches) == 0:
            continue
        approach = views.approach_joints_rad[i]
        target = approach if np.isfinite(approach).all() else near
        if target is None:
            target = np.zeros(6)
        joints[i] = branches[int(np.argmin(_turns(branches - target)))]
        near = joints[i]
    if not np.isfinite(joints).any():
        return views, ()
    note = "joints worked out from the flange poses, by the branch nearest to the frame before"
    return replace(views, joints_rad=joints), (note,)


def _turns(difference: FloatArray) -> FloatArray:
    wrapped = (difference + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(np.abs(wrapped).max(axis=1))


def _approaches(views: Views) -> tuple[Views, tuple[str, ...]]:
    if np.isfinite(views.approach_joints_rad).any() or not np.isfinite(views.joints_rad).any():
        return views, ()
    where = {int(frame): k for k, frame in enumerate(views.frame)}
    approach = np.full_like(views.joints_rad, np.nan)
    for i, frame in enumerate(views.frame):
        before = where.get(int(frame) - 1)
        if before is not None:
            approach[i] = views.joints_rad[before]
    if not np.isfinite(approach).any():
        return views, ()
    note = "where a move came from taken from the frame before"
    return replace(views, approach_joints_rad=approach), (note,)
