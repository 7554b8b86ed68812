"""What the user says of a source that is imported."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calib.views import Mount
from cell.verbs.importing import Take
from cell.verbs.importing.conventions import StatedConvention


@dataclass(frozen=True)
class OfBag:
    """What the user says of a ROS bag; None where nothing.

    Attributes
    ----------
    image, joints:
        Topics.
    base, flange:
        Frames of its transforms, or links of its robot description.
    take:
        Which pictures.
    clock_offset_s:
        To add to a picture's stamp.
    pose:
        Topic of the flange's poses.
    """

    image: str | None = None
    joints: str | None = None
    base: str | None = None
    flange: str | None = None
    take: Take | None = None
    clock_offset_s: float | None = None
    pose: str | None = None


@dataclass(frozen=True)
class Described:
    """What the user says of images and poses.

    Attributes
    ----------
    board:
        In the words of `recording.yaml`.
    poses, joints:
        File or folder of the poses, and of joint angles; None without.
    corners:
        Corner list of another finder; None: the corners are found here.
    rotation, unit, inverted:
        How poses are written; `inverted`: they are flange_from_base. None where not stated: then
        the pictures are asked.
    mount:
        Where the camera sits; None where not stated: on the flange, which is reported.
    robot, name:
        For `recording.yaml`.
    time_bound_s:
        How far apart in time a picture and its pose may be.
    bag:
        What a ROS bag alone has.
    """

    board: dict[str, Any] | None = None
    poses: Path | None = None
    joints: Path | None = None
    corners: Path | None = None
    stated: StatedConvention = field(default_factory=StatedConvention)
    mount: Mount | None = None
    robot: str | None = None
    name: str | None = None
    time_bound_s: float | None = None
    bag: OfBag = field(default_factory=OfBag)
