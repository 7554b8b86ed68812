"""The lengths on the first screen are what they say."""

from __future__ import annotations

import made_up_cell
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cell.views.report.data import ReportData, SolutionPoses
from cell.views.report.geometry import position_error_m, tilt_rad, workpiece_error_m
from cell.views.report.workpiece_error import by_distance, of_solution


def test_a_camera_too_close_has_positive_z_and_costs_that_much_at_the_work_piece() -> None:
    true = made_up_cell.make(9).board_from_camera
    closer = made_up_cell.moved(true, np.array([[0.0, 0.0, 0.004]]) * np.ones((9, 1)))
    assert position_error_m(closer, true) == pytest.approx(np.tile([0, 0, 0.004], (9, 1)))
    error = workpiece_error_m(closer, true, made_up_cell.BOARD)
    assert error == pytest.approx(np.full(9, 0.004))


def test_a_turned_camera_errs_by_angle_times_distance() -> None:
    true = made_up_cell.make(9).board_from_camera
    turned = true.copy()
    turned[:, :3, :3] = true[:, :3, :3] @ Rotation.from_rotvec([1e-3, 0, 0]).as_matrix()
    error = workpiece_error_m(turned, true, made_up_cell.BOARD)
    points = made_up_cell.BOARD.corners_m[None] - true[:, None, :3, 3]
    in_camera = points @ true[:, :3, :3]
    lever = np.sqrt((in_camera[..., 1:] ** 2).sum(axis=2))
    assert error == pytest.approx(1e-3 * np.sqrt((lever**2).mean(axis=1)), rel=1e-3)


def test_tilt_is_the_angle_to_the_board_s_normal() -> None:
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, :3, :3] = Rotation.from_euler("x", 30, degrees=True).as_matrix()
    assert np.degrees(tilt_rad(poses)) == pytest.approx([0, 30])


def test_ranges_of_distance_hold_every_frame_once() -> None:
    made = made_up_cell.make(24)
    poses = made_up_cell.poses_of(made)
    data = ReportData(views=made.views, recording={}, poses=poses)
    found = of_solution(data, "zhang_mle")
    assert found is not None
    steps = by_distance(found)
    assert sum(count for _, _, count, _ in steps) == 24
    total = sum(count * rms**2 for _, _, count, rms in steps) / 24
    assert np.sqrt(total) == pytest.approx(found.rms_m)


def test_without_robot_and_truth_there_is_no_error_at_the_work_piece() -> None:
    made = made_up_cell.make(9)
    poses = {"zhang_mle": SolutionPoses(made.board_from_camera)}
    data = ReportData(views=made.views, recording={}, poses=poses)
    assert of_solution(data, "zhang_mle") is None
