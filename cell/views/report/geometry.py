"""Lengths and angles the report derives from camera poses."""

from __future__ import annotations

import numpy as np

from calib.chain.rigid import inverse
from calib.handeye import camera_position_error_m
from calib.views import Board, FloatArray
from cell.views.report.data import ReportData, SolutionPoses


def centre_m(board: Board) -> FloatArray:
    """(3,) middle of the corner grid, board frame, metres."""
    return np.asarray(board.corners_m.mean(axis=0))


def distance_m(board_from_camera: FloatArray, board: Board) -> FloatArray:
    """(N,) depth of the board's centre along the optical axis, metres."""
    from_camera = centre_m(board) - board_from_camera[:, :3, 3]
    return np.asarray(np.einsum("ni,ni->n", board_from_camera[:, :3, 2], from_camera))


def tilt_rad(board_from_camera: FloatArray) -> FloatArray:
    """(N,) angle between the optical axis and the board's normal, radians."""
    return np.asarray(np.arccos(np.clip(board_from_camera[:, 2, 2], -1.0, 1.0)))


def tilt_direction_rad(board_from_camera: FloatArray) -> FloatArray:
    """(N,) direction in the board plane towards which the optical axis leans, radians."""
    return np.asarray(np.arctan2(board_from_camera[:, 1, 2], board_from_camera[:, 0, 2]))


def position_error_m(
    board_from_camera: FloatArray, board_from_true_camera: FloatArray
) -> FloatArray:
    """(N, 3) computed less true camera position, in the true camera's axes, metres.

    z is the optical axis: a positive z puts the camera too close to the board, as in Figs. 4 and
    15 of Ricolfe-Viala and Esparza.
    """
    return camera_position_error_m(inverse(board_from_camera), inverse(board_from_true_camera))


def workpiece_error_m(
    board_from_camera: FloatArray, board_from_true_camera: FloatArray, board: Board
) -> FloatArray:
    """(N,) RMS distance between the board's corners as located in one picture and as they are.

    A part of the board's size is located by its picture, with the computed pose, and handed to
    the robot, which believes its own camera pose: corner p arrives at T p, with
    T = board_from_true_camera · camera_from_board.
    """
    moved = board_from_true_camera @ inverse(board_from_camera)
    points = board.corners_m
    arrived = points @ moved[:, :3, :3].swapaxes(1, 2) + moved[:, None, :3, 3]
    return np.asarray(np.sqrt(((arrived - points) ** 2).sum(axis=2).mean(axis=1)))


def reference(data: ReportData, poses: SolutionPoses) -> tuple[FloatArray | None, str]:
    """The camera poses errors are measured against, and in words whose they are."""
    if poses.board_from_camera_by_robot is not None:
        return poses.board_from_camera_by_robot, "the robot"
    if data.truth is not None and data.truth.board_from_camera is not None:
        return data.truth.board_from_camera, "the simulator's truth"
    return None, "nothing"


def best_poses(data: ReportData) -> SolutionPoses | None:
    """The poses of the best solution that has any."""
    name = ReportData.best_of(data.poses)
    return None if name is None else data.poses[name]


def frame_distance_m(data: ReportData) -> FloatArray | None:
    """(N,) distance of each frame by the best solution, or else by the diagnosis."""
    poses = best_poses(data)
    if poses is not None:
        return distance_m(poses.board_from_camera, data.views.board)
    return None if data.evidence is None else data.evidence.distance_m
