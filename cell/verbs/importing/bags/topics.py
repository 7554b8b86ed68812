"""Which topics of a bag are meant: those named, else the only ones that can be."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from cell.errors import InputError
from cell.verbs.importing.bags.bag import IMAGE, PICTURES, Bag, Topic

CAMERA_INFO, JOINTS = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/JointState"
POSES = "geometry_msgs/msg/PoseStamped"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
TEXT = "std_msgs/msg/String"

_NO_PICTURE = re.compile(r"depth|disparity|infra|theora|ffmpeg|/ir(?:/|_|$)", re.IGNORECASE)
_SHOWN = 30


def image_topic(bag: Bag, stated: str | None) -> Topic:
    """The topic of the pictures; raises `InputError` with the list where several can be meant."""
    able = _of(bag, *PICTURES)
    if stated is not None:
        return _stated(bag, stated, able, "--image-topic")
    likely = [topic for topic in able if not _NO_PICTURE.search(topic.name)] or able
    # the same pictures, once as they are and once compressed
    raw = {topic.name for topic in likely if topic.type == IMAGE}
    likely = [
        topic for topic in likely if topic.type == IMAGE or topic.name.rsplit("/", 1)[0] not in raw
    ]
    if len(likely) == 1:
        return likely[0]
    if not likely:
        raise InputError(f"{bag.path}: has no pictures. Its topics: {_list(bag.topics.values())}")
    raise InputError(
        f"{bag.path}: several topics have pictures; say which with --image-topic: {_list(likely)}"
    )


def joint_topic(bag: Bag, stated: str | None) -> Topic | None:
    """The topic of the joints, None where there is none; raises `InputError` for several."""
    able = _of(bag, JOINTS)
    if stated is not None:
        return _stated(bag, stated, able, "--joint-topic")
    usual = [topic for topic in able if topic.name == "/joint_states"]
    if usual or len(able) <= 1:
        return next(iter(usual or able), None)
    raise InputError(
        f"{bag.path}: several topics have joints; say which with --joint-topic: {_list(able)}"
    )


def camera_info_topic(bag: Bag, image: Topic) -> str | None:
    """The camera's own topic that stands beside its pictures."""
    names = [topic.name for topic in _of(bag, CAMERA_INFO)]
    above = image.name
    while "/" in above:
        above = above.rsplit("/", 1)[0]
        if f"{above}/camera_info" in names:
            return f"{above}/camera_info"
    return names[0] if len(names) == 1 else None


def transform_topics(bag: Bag) -> list[str]:
    """Every topic of transforms between frames."""
    return [topic.name for topic in _of(bag, *TRANSFORMS)]


def pose_topics(bag: Bag, stated: str | None) -> list[str]:
    """Topics of poses that may be the flange's; raises `InputError` where the one named is none."""
    able = _of(bag, POSES)
    if stated is not None:
        return [_stated(bag, stated, able, "--pose-topic").name]
    return [topic.name for topic in able]


def description_topic(bag: Bag) -> str | None:
    """The topic of the arm's URDF."""
    names = [topic.name for topic in _of(bag, TEXT)]
    return next((name for name in names if name.endswith("robot_description")), None)


def _of(bag: Bag, *types: str) -> list[Topic]:
    return [topic for topic in bag.topics.values() if topic.type in types]


def _stated(bag: Bag, stated: str, able: Sequence[Topic], option: str) -> Topic:
    found = [topic for topic in able if topic.name == stated]
    if found:
        return found[0]
    raise InputError(f"{option} {stated}: is no such topic of {bag.path}; it has {_list(able)}")


def _list(topics: Iterable[Topic]) -> str:
    listed = [f"{t.name} ({t.type}, {t.count})" for t in topics]
    more = [f"and {len(listed) - _SHOWN} more"] if len(listed) > _SHOWN else []
    return ", ".join(listed[:_SHOWN] + more) or "none"
