"""Joints that are not what the log says: degrees for radians, or one that turns the other way."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from calib.chain import rigid
from calib.chain.kinematics import arm
from calib.discovery.log_consistency.mixup import Mixup
from calib.views import FloatArray, Views

_MOST_TURNS_RAD = 4.0 * np.pi
"""No arm's joint goes so far; a log in degrees soon does."""

_BETTER = 0.1
_SUSPECT = 0.02
"""Metres and radians by which logged poses and joints must disagree in the median."""

_MOST_SIGNS = 2


def find_degrees(views: Views) -> Mixup | None:
    """Name joints that are logged in degrees."""
    known = views.joints_rad[np.isfinite(views.joints_rad)]
    if not len(known) or np.abs(known).max() < _MOST_TURNS_RAD:
        return None

    def mend(some: Views, neighbours: Views) -> Views:
        return replace(
            some,
            joints_rad=np.deg2rad(some.joints_rad),
            joint_velocity_rad_s=np.deg2rad(some.joint_velocity_rad_s),
            approach_joints_rad=np.deg2rad(some.approach_joints_rad),
        )

    return Mixup(
        name="angle_unit",
        physics=(
            f"The log says radians, but its joints reach {np.abs(known).max():.0f} and are in"
            " degrees."
        ),
        remedy="Correct the unit in the program that writes the log.",
        mend=mend,
        parameters={"rad_per_unit": (float(np.pi / 180.0), "rad")},
    )


def find_joint_signs(views: Views) -> Mixup | None:
    """Name joints whose logged angle has the other sign than the arm's model, by the poses."""
    known = views.has_pose & np.isfinite(views.joints_rad).all(axis=1)
    if views.robot_model is None or not known.any():
        return None
    joints, poses = views.joints_rad[known], views.base_from_flange[known]
    logged = _disagreement(views.robot_model, joints, poses)
    if logged < _SUSPECT:
        return None
    tried = {
        turned: _disagreement(views.robot_model, joints * _signs(turned), poses)
        for count in range(1, _MOST_SIGNS + 1)
        for turned in combinations(range(joints.shape[1]), count)
    }
    best = min(tried, key=lambda turned: tried[turned])
    if tried[best] > _BETTER * logged:
        return None

    def mend(some: Views, neighbours: Views) -> Views:
        return replace(
            some,
            joints_rad=some.joints_rad * _signs(best),
            joint_velocity_rad_s=some.joint_velocity_rad_s * _signs(best),
            approach_joints_rad=some.approach_joints_rad * _signs(best),
        )

    names = " and ".join(str(joint + 1) for joint in best)
    return Mixup(
        name="joint_sign",
        physics=f"The logged angle of joint {names} has the wrong sign: the poses say so.",
        remedy="Correct the sign in the program that writes the log.",
        mend=mend,
        parameters={f"joint_{joint + 1}": (-1.0, "1") for joint in best},
        evidence=((logged, logged), (tried[best], tried[best])),
    )


def _signs(turned: tuple[int, ...]) -> FloatArray:
    signs = np.ones(6)
    signs[list(turned)] = -1.0
    return signs


def _disagreement(model: str, joints: FloatArray, poses: FloatArray) -> float:
    """Median of how far joints and poses are apart, metres and radians alike, up to one offset.

    A controller's tool, or another base frame, is the same in every frame and is no sign.
    """
    forward = arm(model).forward(joints)
    if len(forward) == 1:
        return 0.0
    by_joints = rigid.inverse(forward[:-1]) @ forward[1:]
    by_poses = rigid.inverse(poses[:-1]) @ poses[1:]
    step = rigid.to_vector(rigid.inverse(by_joints) @ by_poses)
    return float(np.median(np.linalg.norm(step, axis=1)))
