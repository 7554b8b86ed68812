from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.chain.rigid import compose, inverse
from calib.errors import CalibrationError
from calib.handeye import camera_position_error_m, solve_hand_eye
from calib.views import Mount
from tests.paper.scene import BASE_FROM_FIXED, BOARD, FLANGE_FROM_MOUNTED, mixed_scene

CENTRE = BOARD.corners_m.mean(axis=0)


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_exact_without_noise(mount: Mount) -> None:
    true = mixed_scene(mount=mount)
    found = solve_hand_eye(true.camera_from_board, true.views.base_from_flange, mount, CENTRE)
    assert np.allclose(found.flange_from_mounted, FLANGE_FROM_MOUNTED, atol=1e-8)
    assert np.allclose(found.base_from_fixed, BASE_FROM_FIXED, atol=1e-8)
    assert found.rms_m < 1e-8
    again = found.camera_from_board(true.views.base_from_flange)
    assert np.allclose(again, true.camera_from_board, atol=1e-7)


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_order_does_not_matter_and_wrong_pairs_are_dropped(mount: Mount) -> None:
    true = mixed_scene(mount=mount, robot_mm=0.1, robot_deg=0.01)
    flange = true.views.base_from_flange.copy()
    flange[[4, 20]] = flange[[20, 4]]
    found = solve_hand_eye(true.camera_from_board, flange, mount, CENTRE)
    assert set(np.flatnonzero(~found.used)) == {4, 20}
    shuffle = np.random.default_rng(0).permutation(len(flange))
    other = solve_hand_eye(true.camera_from_board[shuffle], flange[shuffle], mount, CENTRE)
    assert np.allclose(other.flange_from_mounted, found.flange_from_mounted, atol=1e-6)
    off = inverse(FLANGE_FROM_MOUNTED) @ found.flange_from_mounted
    assert np.linalg.norm(off[:3, 3]) < 2e-4


def test_sigma_covers_the_truth() -> None:
    pulls = []
    for seed in range(40):
        true = mixed_scene(robot_mm=0.1, robot_deg=0.01, seed=seed)
        found = solve_hand_eye(
            true.camera_from_board, true.views.base_from_flange, "eye_in_hand", CENTRE
        )
        off = inverse(FLANGE_FROM_MOUNTED) @ found.flange_from_mounted
        pulls.append(off[:3, 3] / np.sqrt(np.diag(found.covariance))[:3])
    assert 0.7 < np.sqrt(np.mean(np.square(pulls))) < 1.4


def test_pure_translation_and_one_axis_are_reported() -> None:
    true = mixed_scene()
    flange = np.tile(np.eye(4), (10, 1, 1))
    flange[:, :3, 3] = np.random.default_rng(0).normal(0, 0.2, (10, 3))
    camera = true.camera_from_board[:10]
    with pytest.raises(CalibrationError, match="pure translation"):
        solve_hand_eye(camera, flange, "eye_in_hand", CENTRE)
    turns = np.linspace(-1, 1, 10)[:, None] * [[0.2, 0.9, 0.1]]
    flange[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    with pytest.raises(CalibrationError, match="one axis"):
        solve_hand_eye(camera, flange, "eye_in_hand", CENTRE)


def test_missing_poses_are_left_out_or_refused() -> None:
    true = mixed_scene()
    flange = true.views.base_from_flange.copy()
    flange[5:9] = np.nan
    found = solve_hand_eye(true.camera_from_board, flange, "eye_in_hand", CENTRE)
    assert set(np.flatnonzero(~found.used)) == {5, 6, 7, 8}
    views = replace(true.views, base_from_flange=np.full_like(flange, np.nan))
    with pytest.raises(CalibrationError, match="flange pose"):
        solve_hand_eye(true.camera_from_board, views.base_from_flange, "eye_in_hand", CENTRE)


def test_position_error_is_positive_in_z_when_the_camera_is_computed_too_close() -> None:
    true = mixed_scene().camera_from_board
    closer = compose(np.zeros((len(true), 3)), np.tile([0.0, 0.0, -0.1], (len(true), 1))) @ true
    error = camera_position_error_m(closer, true)
    assert np.allclose(error, [0.0, 0.0, 0.1])


def test_a_log_in_millimetres_is_reported() -> None:
    true = mixed_scene()
    flange = true.views.base_from_flange.copy()
    flange[:, :3, 3] *= 1000
    with pytest.raises(CalibrationError, match="factor of 1000"):
        solve_hand_eye(true.camera_from_board, flange, "eye_in_hand", CENTRE)
