"""The pose errors a report draws are those that were put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.chain.effects import make_effect
from calib.chain.model import CellModel, Errors, predict
from calib.chain.optics import optics_row
from calib.views import Board, Views
from cell.views.report.from_diagnosis import diagnosis_evidence
from cell.views.report.from_simulation import simulation_truth
from cell.views.report.geometry import distance_m
from cell.views.report.pose_errors import pose_errors, scale_at_robot_depth, without_constant_part

ALPHA_PX = 1500.0


def plain() -> CellModel:
    optics = optics_row(
        alpha_px=ALPHA_PX, beta_px=ALPHA_PX, u0_px=640.0, v0_px=360.0, height_px=720.0
    )
    board = np.eye(4)
    board[:3, 3] = [-0.1, -0.07, 0.0]
    return CellModel(optics, np.eye(4), board)


def log(frames: int = 12) -> Views:
    rng = np.random.default_rng(3)
    poses = np.tile(np.eye(4), (frames, 1, 1))
    turn = Rotation.from_rotvec(rng.normal(0, 0.25, (frames, 3))).as_matrix()
    poses[:, :3, :3] = turn
    distance = np.linspace(0.35, 0.9, frames)
    poses[:, :3, 3] = -distance[:, None] * turn[:, :, 2]
    views = Views.blank(Board("chessboard", 7, 10, 0.025), width_px=1280, height_px=720,
                        frames=frames)  # fmt: skip
    return replace(views, base_from_flange=poses)


def recorded(model: CellModel, flange_error: np.ndarray | None = None) -> Views:
    views = log()
    return replace(views, corners_px=predict(model, views, errors=Errors(flange_error)))


def test_a_flange_that_is_elsewhere_than_logged_is_found_to_the_micrometre() -> None:
    error = np.zeros((12, 6))
    error[:, 0], error[:, 2], error[:, 4] = 0.0012, -0.002, 4e-4
    found = pose_errors(plain(), recorded(plain(), error))
    assert found.shift_m == pytest.approx(error[:, :3], abs=1e-6)
    assert found.turn_rad == pytest.approx(error[:, 3:], abs=1e-6)
    assert np.abs(found.residual_px).max() < 1e-6


def test_a_constant_error_of_hand_eye_and_board_is_taken_out() -> None:
    moved = plain()
    moved.base_from_fixed[:3, 3] += [0.0004, -0.0003, 0.0005]
    moved.flange_from_mounted[:3, 3] += [0.0006, 0.0, -0.0002]
    found = pose_errors(plain(), recorded(moved))
    assert np.abs(found.error).max() > 5e-4
    assert np.abs(without_constant_part(found)).max() < 1e-5


def test_breathing_comes_back_as_alpha_of_each_frame() -> None:
    breathing = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 6.0})
    views = recorded(plain().with_effects([breathing]))
    found = pose_errors(plain(), views)
    alpha, sigma = scale_at_robot_depth(found, views, 0.1, 5e-5)
    assert alpha == pytest.approx(ALPHA_PX - 6.0 / found.state.distance_m**2, abs=0.02)
    assert (sigma > ALPHA_PX * 5e-5 / found.state.distance_m).all()


def test_frames_the_diagnosis_left_out_are_missing_after_and_there_before() -> None:
    breathing = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 6.0})
    warp = make_effect("board_warp", {"bend_x_m": 4e-4})
    twin = plain().with_effects([breathing, warp])
    views = recorded(twin)
    found = diagnosis_evidence(views, views.take(np.arange(2, 12)), plain(), twin, corner_px=0.1,
                     flange_m=5e-5)  # fmt: skip
    assert found.shift_before_m is not None
    assert found.shift_after_m is not None
    assert np.isfinite(found.shift_before_m).all()
    assert np.isnan(found.shift_after_m[:2]).all()
    assert np.nanmax(np.abs(found.shift_after_m)) < 1e-6
    assert set(found.shift_without_m) == {"focus_breathing", "board_warp"}
    bare = found.shift_without_m["focus_breathing"]
    assert 1e-3 < found.cost_m["focus_breathing"] < np.sqrt(np.nanmean((bare**2).sum(axis=1)))
    assert found.board_offset_m is not None
    assert np.ptp(found.board_offset_m[:, 2]) == pytest.approx(4e-4, rel=0.02)


def test_the_truth_is_the_simulated_cell_at_the_logged_poses() -> None:
    breathing = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 6.0})
    views = log()
    truth = simulation_truth(plain().with_effects([breathing]), views)
    assert truth.board_from_camera is not None
    assert truth.alpha_px is not None
    distance = distance_m(truth.board_from_camera, views.board)
    assert truth.alpha_px == pytest.approx(ALPHA_PX - 6.0 / distance**2)
    assert truth.effects == ("focus breathing (inverse square)",)


def test_a_board_that_looks_alike_from_both_ends_gives_no_true_poses() -> None:
    views = replace(log(), board=Board("chessboard", 8, 10, 0.025))
    assert simulation_truth(plain(), views).board_from_camera is None
