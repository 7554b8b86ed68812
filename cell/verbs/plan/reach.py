"""Which views the arm can take, and at which joint angles."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.views import FloatArray
from cell.errors import InputError
from cell.sequencer.guard import Guard
from cell.storage.files.cell_file import CellFile, Layout

_FROM_HOME_RAD = np.radians([110.0, 110.0, 110.0, 110.0, 110.0, 200.0])
"""Joints stay this near to home: an arm that folds over or flips its wrist goes a long way."""

_SPEED_M_S, _JOINT_SPEED_RAD_S = 0.1, float(np.radians(30.0))
"""Those of a plan file that does not say its own."""

_SPARE_M = 0.02
"""Plans keep so much more than the cell's clearance: a layout is known to a centimetre or two."""

_WRIST = 4
"""Frame whose origin follows joints 1 to 3 alone, in elbow arms with either kind of wrist."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A view that the arm can take.

    Attributes
    ----------
    station:
        `parallel` or `varied`.
    distance_m:
        Depth of the board's centre.
    base_from_flange, joints_rad:
        (4, 4) and (6,) of the arm.
    """

    station: str
    distance_m: float
    base_from_flange: FloatArray
    joints_rad: FloatArray


def layout_of(cell: CellFile) -> Layout:
    """The cell's layout; raises `InputError` where it has none."""
    if cell.layout is None:
        raise InputError(f"cell {cell.name}: poses need `layout`; measure it with a tape")
    return cell.layout


def planning_guard(cell: CellFile) -> Guard:
    """The cell's guard, at the speeds of a plan that states none, with room to spare."""
    return Guard(cell, _SPEED_M_S, _JOINT_SPEED_RAD_S, spare_m=_SPARE_M)


def reachable(
    station: str, sights: Iterable[RigidTransform], cell: CellFile, guard: Guard
) -> Iterator[Candidate]:
    """Those of the views (camera_from_board) that a free joint move from home leads to.

    The arm keeps to home's side of shoulder and elbow, and near to home in every joint.
    """
    home = np.radians(layout_of(cell).home_deg)
    centre = cell.board.board().corners_m.mean(axis=0)
    for camera_from_board in sights:
        pose = flange_pose(cell, camera_from_board)
        for joints in usual_branches(pose, home, guard):
            if guard.may_move(home, joints):
                depth = float(camera_from_board.apply(centre)[2])
                yield Candidate(station, depth, pose, joints)
                break


def flange_pose(cell: CellFile, camera_from_board: RigidTransform) -> FloatArray:
    """(4, 4) base_from_flange from which the camera has the board there."""
    layout = layout_of(cell)
    middle = camera_from_board.inv() if cell.mount == "eye_in_hand" else camera_from_board
    return (layout.fixed.transform() * middle * layout.mounted.transform().inv()).as_matrix()


def usual_branches(pose: FloatArray, home: FloatArray, guard: Guard) -> FloatArray:
    """(B, 6) joint angles that reach a flange pose in the arm's usual posture, nearest first."""
    branches = guard.kinematics.inverse_all(pose, home)
    near = (np.abs(branches - home) <= _FROM_HOME_RAD).all(axis=1)
    same = _posture(guard, branches) == _posture(guard, home)
    return np.asarray(branches[near & same])


def _posture(guard: Guard, joints_rad: FloatArray) -> FloatArray:
    """(...) sign that turns over where shoulder or elbow goes through its singularity."""
    frames = guard.kinematics.frames(joints_rad)
    axes = frames[..., :3, :3, 2]
    arms = frames[..., _WRIST : _WRIST + 1, :3, 3] - frames[..., :3, :3, 3]
    return np.asarray(np.sign(np.linalg.det(np.cross(axes, arms))))
