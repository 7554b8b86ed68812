"""The whole calibration on synthetic cells whose truth is known."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.calibration import Calibration, Statistics, calibrate
from calib.calibration.mapping import as_mapping
from calib.errors import CalibrationError
from calib.handeye import camera_position_error_m
from cell.storage.files.calibration_file import CalibrationFile
from tests.paper.scene import (
    ALPHA0,
    BASE_FROM_FIXED,
    FLANGE_FROM_MOUNTED,
    U0,
    V0,
    Scene,
    mixed_scene,
    scene,
)

LENSES: dict[str, dict[str, float]] = {
    "constant": {},
    "inverse_square": {"k_px_m2": 30.0},
    "thin_lens": {"thin_f_m": 0.02},
}


@cache
def _breathing() -> tuple[Scene, Calibration]:
    """Flat views over distance, as the paper's, of a lens that obeys Eq. 25."""
    rng = np.random.default_rng(5)
    distance = np.concatenate([np.geomspace(0.32, 1.5, 14), np.linspace(0.32, 1.5, 16)])
    tilt = np.concatenate([rng.uniform(0, 1, 14), rng.uniform(4, 14, 16)])
    true = scene(
        distance_m=distance,
        tilt_deg=tilt,
        noise_px=0.1,
        k_px_m2=50.0,
        k1=-0.05,
        robot_mm=0.03,
        robot_deg=0.003,
    )
    return true, calibrate(true.views)


def _error(true: Scene, calibration: Calibration, name: str) -> Statistics:
    poses = calibration.solutions[name].camera_from_board
    return Statistics.of(camera_position_error_m(poses, true.camera_from_board))


@pytest.mark.parametrize("lens", LENSES)
def test_without_noise_the_truth_comes_back(lens: str) -> None:
    true = mixed_scene(k1=-0.08, k2=0.03, noise_px=1e-4, robot_mm=1e-5, **LENSES[lens])
    found = calibrate(true.views)
    assert found.focus_law is not None
    assert found.focus_law.preferred.law == lens
    assert found.robot is not None
    assert np.allclose(found.robot.flange_from_mounted, FLANGE_FROM_MOUNTED, atol=1e-6)
    assert np.allclose(found.robot.base_from_fixed, BASE_FROM_FIXED, atol=1e-6)
    for name in ("fixed_alpha_mle", "joint_ml"):
        assert _error(true, found, name).rms < 5e-6
        values = found.solutions[name].values
        assert values["u0_px"] == pytest.approx(U0, abs=0.01)
        assert values["v0_px"] == pytest.approx(V0, abs=0.01)
        assert values["k1"] == pytest.approx(-0.08, abs=1e-4)


def test_zhang_s_fit_looks_fine_and_puts_the_cameras_too_close() -> None:
    true, found = _breathing()
    zhang = _error(true, found, "zhang_mle")
    assert found.solutions["zhang_mle"].reprojection_px["rms"] < 0.3
    assert zhang.mean[2] > 0.015
    assert zhang.rms > 0.030


def test_the_fixed_alpha_fit_puts_them_where_they_are() -> None:
    true, found = _breathing()
    fixed = _error(true, found, "fixed_alpha_mle")
    assert abs(fixed.mean[2]) < 0.0005
    assert fixed.rms < 0.05 * _error(true, found, "zhang_mle").rms
    assert _error(true, found, "joint_ml").rms < 0.05 * _error(true, found, "zhang_mle").rms


def test_the_order_of_the_biases_is_the_paper_s() -> None:
    _, found = _breathing()
    assert found.focus_law is not None
    alpha0 = found.focus_law.preferred.parameters["alpha0_px"].value
    algebraic = found.solutions["zhang_algebraic"].values["alpha_px"]
    mle = found.solutions["zhang_mle"].values["alpha_px"]
    assert alpha0 == pytest.approx(ALPHA0, abs=3.0)
    assert alpha0 > algebraic
    assert alpha0 > mle


def test_own_hand_eye_hides_the_constant_part_of_the_error() -> None:
    true, found = _breathing()
    error = found.position_error["zhang_mle"]
    assert error.own is not None
    truth = _error(true, found, "zhang_mle")
    assert Statistics.of(error.common).rms == pytest.approx(truth.rms, rel=0.05)
    assert abs(Statistics.of(error.own).mean[2]) < 0.2 * truth.mean[2]
    assert Statistics.of(error.own).rms < 0.9 * truth.rms


def test_sigma_of_alpha_covers_the_truth() -> None:
    pulls = []
    for seed in range(40):
        true = mixed_scene(noise_px=0.1, seed=seed).views
        unposed = replace(true, base_from_flange=np.full((len(true), 4, 4), np.nan))
        mle = calibrate(unposed).solutions["zhang_mle"]
        pulls.append((mle.values["alpha_px"] - ALPHA0) / mle.sigma["alpha_px"])
    assert 0.75 < np.sqrt(np.mean(np.square(pulls))) < 1.3


def test_without_poses_there_is_zhang_and_the_reason_for_the_rest() -> None:
    true = mixed_scene(noise_px=0.1)
    views = replace(true.views, base_from_flange=np.full((len(true.views), 4, 4), np.nan))
    found = calibrate(views)
    assert set(found.solutions) == {"zhang_mle", "zhang_algebraic", "zhang_mle_no_skew"}
    assert found.solutions["zhang_mle_no_skew"].values["skew_px"] == 0.0
    assert found.robot is None
    for name in ("joint_ml", "zones", "focus_law", "fixed_alpha_mle"):
        assert "no frame has a logged flange pose" in found.missing[name]


def test_frames_partly_without_poses_are_used_for_what_they_can() -> None:
    true = mixed_scene(noise_px=0.1)
    flange = true.views.base_from_flange.copy()
    flange[::5] = np.nan
    found = calibrate(replace(true.views, base_from_flange=flange))
    assert found.used.all()
    assert np.isfinite(found.solutions["zhang_mle"].camera_from_board).all()
    assert np.isnan(found.solutions["joint_ml"].camera_from_board[::5]).all()


def test_without_parallel_views_tilted_ones_serve_and_it_is_reported() -> None:
    rng = np.random.default_rng(2)
    true = scene(
        distance_m=rng.uniform(0.35, 1.2, 24),
        tilt_deg=rng.uniform(15, 40, 24),
        noise_px=0.1,
        k_px_m2=30.0,
    )
    found = calibrate(true.views)
    assert "0 views are parallel" in found.missing["parallel_views"]
    assert found.focus_law is not None
    fitted = found.focus_law.preferred.parameters["k_px_m2"]
    assert abs(fitted.value - 30.0) < 4 * fitted.sigma


def test_wrong_detections_are_rejected_with_the_reason() -> None:
    true = mixed_scene(noise_px=0.1)
    corners = true.views.corners_px.copy()
    rng = np.random.default_rng(3)
    corners[7] += rng.normal(0, 25, corners[7].shape)
    corners[11] = np.nan
    corners[13, 5:] = np.nan
    found = calibrate(replace(true.views, corners_px=corners))
    reasons = {r.frame: r.reason for r in found.rejected}
    assert set(reasons) == {7, 11, 13}
    assert "wrong detection" in reasons[7]
    assert reasons[11] == "no corners"
    assert "only 5 corners" in reasons[13]


def test_close_views_of_a_lens_that_moves_are_not_called_wrong() -> None:
    _, found = _breathing()
    assert found.rejected == ()
    assert found.robot is not None
    assert found.robot.outliers == ()


def test_a_swapped_pair_of_poses_is_named_and_harms_nothing() -> None:
    true = mixed_scene(noise_px=0.1)
    flange = true.views.base_from_flange.copy()
    flange[[15, 20]] = flange[[20, 15]]
    found = calibrate(replace(true.views, base_from_flange=flange))
    assert found.robot is not None
    assert found.robot.outliers == (15, 20)
    assert _error(true, found, "joint_ml").rms < 1e-3


def test_two_frames_are_refused() -> None:
    true = mixed_scene(noise_px=0.1)
    with pytest.raises(CalibrationError, match="2 of 2 frames are usable"):
        calibrate(true.views.take(np.array([0, 20])))


def test_frames_of_one_orientation_are_refused() -> None:
    true = scene(distance_m=np.linspace(0.4, 0.8, 8), tilt_deg=np.zeros(8), noise_px=0.05)
    with pytest.raises(CalibrationError, match="tilt"):
        calibrate(true.views)


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_the_file_fits_its_published_schema(mount: str) -> None:
    true = mixed_scene(noise_px=0.1, mount=mount)
    content = as_mapping(calibrate(true.views), "bench")
    CalibrationFile.model_validate(content)
    mounted, fixed = (
        ("flange_from_camera", "base_from_board")
        if mount == "eye_in_hand"
        else ("flange_from_board", "base_from_camera")
    )
    assert np.allclose(content[mounted]["p_m"], FLANGE_FROM_MOUNTED[:3, 3], atol=1e-3)
    assert np.allclose(content[fixed]["p_m"], BASE_FROM_FIXED[:3, 3], atol=1e-3)
    assert content["solutions"]["joint_ml"]["camera_position_error_m"]["robot_in_it"]
    assert not content["solutions"]["zhang_mle"]["camera_position_error_m"]["robot_in_it"]


@pytest.mark.parametrize("lens", ["inverse_square", "thin_lens"])
def test_the_joint_fit_reports_its_own_focus_with_its_covariance(lens: str) -> None:
    true = mixed_scene(noise_px=0.05, robot_mm=0.02, robot_deg=0.002, **LENSES[lens])
    found = calibrate(true.views)
    joint = found.solutions["joint_ml"]
    assert joint.focus is not None
    assert joint.covariance is not None
    reported = {name: p.value for name, p in joint.focus.parameters.items()}
    far, bend = ("alpha0_px", "k_px_m2") if lens == "inverse_square" else ("alpha_inf_px", "f_m")
    assert reported[far] == pytest.approx(ALPHA0, abs=2.0)
    (truth,) = LENSES[lens].values()
    sigma = joint.focus.parameters[bend].sigma
    assert abs(reported[bend] - truth) < 4 * sigma
    at = joint.covariance.names.index(bend)
    assert joint.covariance.matrix[at, at] == pytest.approx(sigma**2)
    names = as_mapping(found, "bench")["solutions"]["joint_ml"]["covariance"]["names"]
    assert {far, bend, "flange_from_camera.x", "base_from_board.rz"} < set(names)
    near, farthest = found.distance_range_m
    assert near == pytest.approx(true.depth_m.min(), rel=0.02)
    assert farthest == pytest.approx(true.depth_m.max(), rel=0.02)
