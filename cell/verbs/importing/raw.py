"""Poses as other tools write them: plain numbers, before anybody says what they mean."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calib.views import FloatArray
from cell.verbs.importing import RotationName, Unit

WIDTHS = (6, 7, 12, 16)
"""Numbers in a pose: position and three angles, position and quaternion, 3x4 or 4x4 matrix."""

Role = Literal["flange", "board", "joints", "other"]


@dataclass(frozen=True)
class RawPose:
    """One pose's numbers.

    Attributes
    ----------
    where:
        File and line or key, for messages.
    number:
        Which image it belongs to, where the file states; its place in the file otherwise is None.
    values:
        6, 7, 12 or 16 numbers.
    rotations, unit:
        What names in the file say of them; empty and None where they do not.
    name:
        The image's name, or the pose's own, where the file states.
    time_s:
        When it was taken, by the file's own clock.
    """

    where: str
    number: int | None
    values: FloatArray
    rotations: tuple[RotationName, ...] = ()
    unit: Unit | None = None
    name: str | None = None
    time_s: float | None = None


@dataclass(frozen=True)
class Series:
    """Poses, or joint angles, that belong together: one row each of one meaning.

    Attributes
    ----------
    layout:
        What the file is, in the field's words.
    key:
        Where in the file they stand: the path of keys, numbers left out.
    role:
        What the key's words say they are of.
    poses:
        In the file's order.
    notes:
        What was concluded in reading them, to be reported.
    joint_names:
        For joint angles, where the file names them.
    """

    layout: str
    key: str
    role: Role
    poses: tuple[RawPose, ...]
    notes: tuple[str, ...] = ()
    joint_names: tuple[str, ...] = ()

    @property
    def values(self) -> FloatArray:
        """(N, width) the numbers."""
        return np.array([pose.values for pose in self.poses])

    def with_notes(self, *notes: str) -> Series:
        """The same with more to say."""
        return replace(self, notes=(*self.notes, *notes))
