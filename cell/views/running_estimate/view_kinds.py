"""Which distances and tilts a plan has, which were seen, and what is still lacking."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from calib.views import Board, FloatArray
from cell.errors import InputError
from cell.sequencer.guard import Guard
from cell.storage.files.plan_file import Plan

FLAT_RAD = np.radians(10.0)
"""Less tilted than this counts as flat."""

_OF_EACH = 2
_TILTS = ("turned to the left or right", "tipped up or down")


def planned_flange_poses(plan: Plan) -> FloatArray:
    """(V, 4, 4) base_from_flange of a plan's views.

    Raises
    ------
    InputError
        The arm is not known, or a view has too many or too few joint angles.
    """
    kinematics, poses = Guard.of(plan).kinematics, []
    for index, view in enumerate(plan.file.views):
        joints = view.joints()
        if joints is None:
            assert view.base_from_flange is not None
            poses.append(view.base_from_flange.transform().as_matrix())
        elif len(joints) == len(kinematics.limits_rad):
            poses.append(kinematics.forward(np.array(joints)))
        else:
            raise InputError(f"{plan.where(index)}: has {len(joints)} joint angles, the arm has 6")
    return np.array(poses)


@dataclass(frozen=True)
class Sights:
    """How boards stand before the camera.

    Attributes
    ----------
    distance_m:
        (N,) depth of the board's middle.
    tilt_rad, direction_rad:
        (N,) angle between the optical axis and the board's normal, and where in the image the
        normal leans to: 0 to the right, a quarter turn down.
    """

    distance_m: FloatArray
    tilt_rad: FloatArray
    direction_rad: FloatArray

    @classmethod
    def of(cls, camera_from_board: FloatArray, board: Board) -> Sights:
        """From (N, 4, 4) poses."""
        middle = np.append(board.corners_m.mean(axis=0), 1.0)
        normal = camera_from_board[:, :3, 2]
        return cls(
            camera_from_board[:, 2] @ middle,
            np.arccos(np.clip(normal[:, 2], -1.0, 1.0)),
            np.arctan2(normal[:, 1], normal[:, 0]),
        )

    def tilted(self, axis: int) -> int:
        """How many are tilted, and more along that axis of the image than along the other."""
        along = np.abs([np.cos(self.direction_rad), np.sin(self.direction_rad)])
        return int(((self.tilt_rad >= FLAT_RAD) & (along[axis] >= along[1 - axis])).sum())

    def between(self, low_m: float, high_m: float) -> int:
        """How many are at such distances."""
        return int(((self.distance_m >= low_m) & (self.distance_m <= high_m)).sum())


def lacking(planned: Sights, seen: Sights) -> tuple[str, ...]:
    """What a plan has and the frames so far do not, as text; empty where nothing is lacking.

    Every third of the planned distances must be seen twice, and boards tilted along either axis of
    the image twice, or as often as the plan has them where that is less.
    """
    edges = np.linspace(planned.distance_m.min(), planned.distance_m.max(), 4)
    slack = 0.05 * np.ptp(edges)  # a tape measure's plan is not met to the millimetre
    lacks = []
    for low, high in pairwise(edges):
        has, got = (s.between(low - slack, high + slack) for s in (planned, seen))
        if got < min(has, _OF_EACH):
            lacks.append(f"views at {low:.2f} to {high:.2f} m")
    for axis, where in enumerate(_TILTS):
        has, got = (s.tilted(axis) for s in (planned, seen))
        if got < min(has, _OF_EACH):
            lacks.append(f"views of the board {where}")
    return tuple(lacks)
