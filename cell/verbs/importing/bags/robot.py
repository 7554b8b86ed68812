"""Where the flange was: by a bag's transforms, else by its joints and the arm's kinematics."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from calib.chain.kinematics import (
    MODELS,
    ArmKinematics,
    UnknownArm,
    UnusableUrdf,
    arm,
    arm_from_urdf,
    joint_names,
)
from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing.bags.contents import Contents
from cell.verbs.importing.bags.tracks import Joints, away_s
from cell.verbs.importing.bags.transforms import Way, way_between, way_of_topic

_UR_ORDER = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_BASES, _FLANGES = ("base", "base_link"), ("tool0", "flange")


@dataclass(frozen=True)
class Description:
    """The arm's URDF, and its links that count as base and flange."""

    text: str
    base: str
    flange: str


@dataclass(frozen=True)
class Robot:
    """What moves the flange.

    Attributes
    ----------
    way, joints, kinematics:
        Transforms, joint angles and the arm; None where the bag does not report.
    description:
        Where the bag has it and it describes an arm of six joints.
    notes:
        What was concluded, to be reported.
    """

    way: Way | None
    joints: Joints | None
    kinematics: ArmKinematics | None
    description: Description | None
    notes: tuple[str, ...]

    @property
    def has_poses(self) -> bool:
        """Whether anything states where the flange was."""
        return self.way is not None or self._by_joints is not None

    @property
    def _by_joints(self) -> tuple[Joints, ArmKinematics] | None:
        if self.joints is None or self.kinematics is None:
            return None
        return (self.joints, self.kinematics) if self.joints.angles_rad.shape[1] == 6 else None

    def poses(self, times_s: FloatArray) -> FloatArray:
        """(N, 4, 4) base_from_flange between the samples around each time."""
        if self.way is not None:
            return self.way.at(times_s)
        assert self._by_joints is not None
        joints, kinematics = self._by_joints
        return kinematics.forward(joints.at(times_s))

    def away_s(self, times_s: FloatArray) -> FloatArray:
        """(N,) how far in time the farther of the samples is that a pose lies between."""
        if self.way is not None:
            return self.way.away_s(times_s)
        assert self.joints is not None
        return away_s(self.joints.times_s, times_s)


def find_robot(
    contents: Contents,
    model: str | None,
    base: str | None,
    flange: str | None,
    pose: str | None = None,
) -> Robot:
    """What the bag, and the user, say of the arm; raises `InputError` for a wrong name."""
    notes: list[str] = []
    if pose is not None:
        way: Way | None = way_of_topic(contents.transforms, pose, base)
    else:
        way = way_between(contents.transforms, base, flange)
    kinematics, description, names = _arm(contents, model, base, flange, notes)
    found = contents.joints(names)
    joints = None if found is None else found[1]
    if found is not None and names is None:
        joints = _in_order(found[0], found[1], notes)
    if way is None and kinematics is None and flange is None:
        way = _only_pose_topic(contents, base)
    if way is not None and way.flange in contents.pose_topics:
        notes.append(
            f"poses are those of {way.flange} in {way.base}, taken for the flange's; a tool that"
            " is set at the controller may be in them"
        )
    elif way is not None:
        notes.append(f"poses are the transforms from {way.base} to {way.flange}")
    elif joints is not None and kinematics is not None:
        notes.append(f"poses are made of the joints by the kinematics of {kinematics.name}")
    return Robot(way, joints, kinematics, description, tuple(notes))


def _only_pose_topic(contents: Contents, base: str | None) -> Way | None:
    """Of several none can be meant without being named: goals are published as poses, too."""
    if len(contents.pose_topics) > 1:
        raise InputError(
            "several topics have poses, and neither transforms nor joints state the flange's; say"
            f" which with --pose-topic: {', '.join(contents.pose_topics)}"
        )
    return next(
        (way_of_topic(contents.transforms, name, base) for name in contents.pose_topics), None
    )


def _arm(
    contents: Contents, model: str | None, base: str | None, flange: str | None, notes: list[str]
) -> tuple[ArmKinematics | None, Description | None, tuple[str, ...] | None]:
    """The arm that is named, else the one that the bag describes, with its joints' names."""
    if model is not None:
        try:
            return arm(model), None, None
        except UnknownArm as fault:
            raise InputError(f"--robot {model}: {fault}") from None
    if contents.description is None:
        return None, None, None
    text, why = contents.description, ""
    for start in [base] if base else _BASES:
        for end in [flange] if flange else _FLANGES:
            try:
                kinematics = arm_from_urdf(text, start, end, "the bag's robot_description")
            except UnusableUrdf as fault:
                why = why or str(fault)
                continue
            notes.append(f"the arm is the bag's robot_description from {start} to {end}")
            return kinematics, Description(text, start, end), joint_names(text, start, end)
    notes.append(f"the bag's robot_description is not used: it {why} (say --base and --flange)")
    return None, None, None


def _in_order(names: tuple[str, ...], joints: Joints, notes: list[str]) -> Joints:
    """From base to flange: ROS publishes joints in any order, often that of the alphabet."""
    places = [next((k for k, n in enumerate(names) if word in n), None) for word in _UR_ORDER]
    if None not in places:
        order = [int(k) for k in places if k is not None]
    else:
        numbers = [re.findall(r"\d+", name)[-1:] for name in names]
        counted = all(numbers) and len({n[0] for n in numbers}) == len(names)
        order = [int(k) for k in np.argsort([int(n[0]) for n in numbers])] if counted else []
    if not order:
        notes.append(f"the joints are taken in the order of the bag: {', '.join(names)[:200]}")
        return joints
    return Joints(joints.times_s, joints.angles_rad[:, order])


def no_poses(robot: Robot, contents: Contents) -> str:
    """What to say where nothing states where the flange was."""
    frames = ", ".join(contents.transforms.frames[:20]) or "none"
    return (
        "no flange poses: the lens alone can be calibrated. Name the frames of the transforms with"
        f" --base and --flange (the bag has {frames}), the topic of the flange's poses with"
        " --pose-topic, or the arm of its joints with --robot"
        f" ({', '.join(sorted(MODELS)[:3])} ...)"
    )
