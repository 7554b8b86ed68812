"""What a bag holds beside the pixels, read once: times of pictures, joints, transforms, arm."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.incoming import limits
from cell.verbs.importing.bags import topics
from cell.verbs.importing.bags.bag import Bag, Topic
from cell.verbs.importing.bags.tracks import Joints, sorted_once
from cell.verbs.importing.bags.transforms import Transforms

_NS = 1e-9


@dataclass
class Contents:
    """Of one bag.

    Attributes
    ----------
    start_ns:
        What second 0 of all times is, by the stamps.
    image:
        The topic of the pictures.
    picture_s:
        When each of its messages was stamped, in the order of the bag.
    camera_info:
        The camera's own message, or None.
    transforms:
        Of every transform topic; a topic of poses is a frame under the topic's name.
    pose_topics:
        Names of those.
    joint_samples:
        Names, and (time, angles) under these names.
    description:
        The arm's URDF, or None.
    unstamped:
        Pictures without a stamp, of which the time of receipt was taken.
    """

    image: Topic
    start_ns: int | None = None
    picture_s: list[float] = field(default_factory=list)
    camera_info: Any = None
    transforms: Transforms = field(default_factory=Transforms)
    pose_topics: tuple[str, ...] = ()
    joint_samples: dict[tuple[str, ...], list[tuple[float, Any]]] = field(default_factory=dict)
    description: str | None = None
    unstamped: int = 0

    def seconds(self, header: Any, received_ns: int) -> float:
        """Of a message's stamp since the first; of its receipt where it has none."""
        stamp = header.stamp
        stamp_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
        at_ns = stamp_ns or received_ns
        if self.start_ns is None:
            self.start_ns = at_ns
        return _NS * (at_ns - self.start_ns)

    def joints(
        self, wanted: tuple[str, ...] | None = None
    ) -> tuple[tuple[str, ...], Joints] | None:
        """Names and track of the joints wanted, in that order; of the most frequent ones without.

        Two publishers may share the topic: an arm and its gripper.
        """
        counts = Counter({names: len(s) for names, s in self.joint_samples.items()})
        for names, _ in counts.most_common():
            order = tuple(wanted or names)
            if not set(order) <= set(names):
                continue
            samples = self.joint_samples[names]
            columns = [names.index(name) for name in order]
            angles = np.array([values for _, values in samples], dtype=float)[:, columns]
            times = np.array([time for time, _ in samples])
            good = np.isfinite(angles).all(axis=1)
            if good.any():
                return order, Joints(*sorted_once(times[good], angles[good]))
        return None

    @property
    def times_s(self) -> FloatArray:
        """(P,) of the pictures."""
        return np.array(self.picture_s)


def read_contents(
    bag: Bag, image: Topic, joint_topic: Topic | None, pose_topics: tuple[str, ...] = ()
) -> Contents:
    """Everything but the pixels; raises `InputError` for a message that cannot be what it says."""
    found = Contents(image, pose_topics=pose_topics)
    info = topics.camera_info_topic(bag, image)
    description = topics.description_topic(bag)
    transforms = topics.transform_topics(bag)
    joints = None if joint_topic is None else joint_topic.name
    wanted = {image.name, info, description, joints, *transforms, *pose_topics} - {None}
    messages = bag.messages({name for name in wanted if name})
    for count, (topic, received_ns, message) in enumerate(messages):
        if count >= limits.MESSAGES:
            raise InputError(f"{bag.path}: more than {limits.MESSAGES} messages; cut it shorter")
        if topic == image.name:
            found.unstamped += not (message.header.stamp.sec or message.header.stamp.nanosec)
            found.picture_s.append(found.seconds(message.header, received_ns))
        elif topic == info:
            found.camera_info = found.camera_info or message
        elif topic == description:
            found.description = str(message.data)
        elif topic == joints:
            _add_joints(found, message, received_ns)
        elif topic in pose_topics:
            found.transforms.add_pose(message, topic, found.seconds(message.header, received_ns))
        else:
            for stamped in message.transforms:
                still = topic.endswith("static")
                at = found.seconds(stamped.header, received_ns)
                found.transforms.add(stamped, at, still=still)
    return found


def _add_joints(found: Contents, message: Any, received_ns: int) -> None:
    names = tuple(str(name) for name in message.name)
    if len(names) != len(message.position):
        raise InputError(
            f"a message of joints has {len(names)} names and {len(message.position)} positions"
        )
    at = found.seconds(message.header, received_ns)
    found.joint_samples.setdefault(names, []).append((at, np.asarray(message.position)))
