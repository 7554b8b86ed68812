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
    said: tuple[str, ...]


def recover(views: Views, log: Views) -> Recovered:
    """Fill in poses from joints, joints from poses, and approaches from the order of the log.

    Parameters
    ----------
    views:
        The frames.
    log:
        Every row of the log that is known, the frames' own among them.
    """
    said: list[str] = []
    kinematics = None if views.robot_model is None else arm(views.robot_model)
    if kinematics is not None:
        views, said = _poses_from_joints(views, kinematics, said)
        views, said = _joints_from_poses(views, kinematics, said)
    views, said = _approaches(views, log, said)
    return Recovered(views, tuple(said))


def _poses_from_joints(
    views: Views, kinematics: ArmKinematics, said: list[str]
) -> tuple[Views, list[str]]:
    lacking = ~views.has_pose & np.isfinite(views.joints_rad).all(axis=1)
    if not lacking.any():
        return views, said
    poses = views.base_from_flange.copy()
    poses[lacking] = kinematics.forward(views.joints_rad[lacking])
    said = [*said, f"flange poses of {int(lacking.sum())} frames worked out from the joints"]
    return replace(views, base_from_flange=poses), said


def _joints_from_poses(
    views: Views, kinematics: ArmKinematics, said: list[str]
) -> tuple[Views, list[str]]:
    if np.isfinite(views.joints_rad).any() or not views.has_pose.any():
        return views, said
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
        return views, said
    words = "joints worked out from the flange poses, by the branch nearest to the frame before"
    return replace(views, joints_rad=joints), [*said, words]


def _turns(difference: FloatArray) -> FloatArray:
    wrapped = (difference + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(np.abs(wrapped).max(axis=1))


def _approaches(views: Views, log: Views, said: list[str]) -> tuple[Views, list[str]]:
    if np.isfinite(views.approach_joints_rad).any() or not np.isfinite(views.joints_rad).any():
        return views, said
    where = {int(frame): k for k, frame in enumerate(log.frame)}
    approach = np.full_like(views.joints_rad, np.nan)
    joints = log.joints_rad if np.isfinite(log.joints_rad).any() else views.joints_rad
    source = log.frame if joints is log.joints_rad else views.frame
    where = {int(frame): k for k, frame in enumerate(source)}
    for i, frame in enumerate(views.frame):
        before = where.get(int(frame) - 1)
        if before is not None:
            approach[i] = joints[before]
    if not np.isfinite(approach).any():
        return views, said
    words = "where a move came from taken from the frame before"
    return replace(views, approach_joints_rad=approach), [*said, words]
