"""Mix-ups in the log are found, mended and named, and a clean log has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calib.chain import rigid
from calib.chain.kinematics import arm
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_repair import LogRepair, repair_log
from calib.discovery.rejections import lost_frames
from calib.views import FloatArray, Views
from cell.devices.log_mixups import _scalar_first, mix_up
from cell.storage.files.cell_file import EffectFile
from tests.discovery.simulated_runs import BOARD, log, plain_cell, record

CLEAN = record(plain_cell(), log(30), seed=41)


def mixed_up(name: str, **parameters: float) -> Views:
    effect = EffectFile(name=name, parameters=parameters)
    return mix_up(CLEAN, effect, np.random.default_rng(3))


def log_repair_of(views: Views) -> LogRepair:
    return repair_log(views, views)


def only(repaired: LogRepair) -> Mixup:
    (found,) = repaired.mixups
    return found


def test_a_clean_log_has_no_mixup():
    repaired = log_repair_of(CLEAN)
    assert repaired.mixups == ()
    assert repaired.rejected == ()
    assert len(repaired.views) == len(CLEAN)


@pytest.mark.parametrize("metres", [1e-3, 0.0254])
def test_a_unit_is_read_from_the_scale(metres):
    repaired = log_repair_of(mixed_up("length_unit", metres_per_unit=metres))
    assert only(repaired).name == "length_unit"
    np.testing.assert_allclose(
        repaired.views.base_from_flange[:, :3, 3], CLEAN.base_from_flange[:, :3, 3], rtol=1e-9
    )


def test_a_scalar_first_quaternion_is_found():
    views = replace(CLEAN, base_from_flange=_scalar_first(CLEAN.base_from_flange))
    repaired = log_repair_of(views)
    assert only(repaired).name == "rotation_convention"
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange, atol=1e-9)


def test_inverted_poses_are_found():
    repaired = log_repair_of(replace(CLEAN, base_from_flange=rigid.inverse(CLEAN.base_from_flange)))
    assert only(repaired).name == "rotation_convention"
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange, atol=1e-9)


def test_a_pose_belonging_to_the_frame_before_is_found():
    repaired = log_repair_of(mixed_up("frame_pose_offset", frames=1))
    assert only(repaired).name == "frame_pose_offset"
    assert abs(only(repaired).parameters["frames"][0]) == 1.0
    rows = np.searchsorted(CLEAN.frame, repaired.views.frame)
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange[rows])


def test_two_swapped_frames_are_named_and_set_right():
    views = mixed_up("frame_pose_swap", frames=2)
    swapped = np.flatnonzero(
        np.abs(views.base_from_flange - CLEAN.base_from_flange).max(axis=(1, 2)) > 0
    )
    assert len(swapped) == 2
    repaired = log_repair_of(views)
    assert only(repaired).name == "frame_pose_swap"
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange)


def test_the_kinematics_of_another_arm_are_found():
    repaired = log_repair_of(replace(CLEAN, base_from_flange=arm("ur5").forward(CLEAN.joints_rad)))
    assert only(repaired).name == "robot_model"


def test_one_wrong_pose_is_left_out_and_the_rest_is_used():
    poses = CLEAN.base_from_flange.copy()
    poses[7, :3, 3] += 0.05
    repaired = log_repair_of(replace(CLEAN, base_from_flange=poses))
    assert [r.frame for r in repaired.rejected] == [int(CLEAN.frame[7])]
    assert len(repaired.views) == len(CLEAN) - 1


def with_pictures(rows: list[int] | np.ndarray) -> Views:
    """The clean recording with each frame's picture taken from that row."""
    rows = np.asarray(rows)
    return replace(
        CLEAN, corners_px=CLEAN.corners_px[rows], corner_sigma_px=CLEAN.corner_sigma_px[rows]
    )


def true_poses(rows: list[int] | np.ndarray) -> FloatArray:
    return np.asarray(CLEAN.base_from_flange[np.asarray(rows)])


@pytest.mark.parametrize("late", [1, 2])
def test_a_run_of_stale_pictures_is_reported_with_where_it_starts_and_ends(late):
    rows = np.arange(len(CLEAN))
    rows[8:21] -= late
    found = log_repair_of(with_pictures(rows))
    mixup = only(found)
    assert mixup.name == "stale_pictures"
    assert mixup.parameters["from_frame"][0] == CLEAN.frame[8]
    assert mixup.parameters["to_frame"][0] == CLEAN.frame[20]
    assert f"from frame {CLEAN.frame[8]} to {CLEAN.frame[20]}" in mixup.physics
    np.testing.assert_allclose(found.views.base_from_flange, true_poses(rows))


def test_a_picture_that_was_written_twice_is_reported():
    rows = np.arange(len(CLEAN))
    rows[12] = 11
    found = log_repair_of(with_pictures(rows))
    mixup = only(found)
    assert mixup.name == "stale_pictures"
    assert f"pose {CLEAN.frame[11]} was taken twice" in mixup.physics
    np.testing.assert_allclose(found.views.base_from_flange, true_poses(rows))


def test_pictures_that_ran_ahead_at_the_end_are_reported_one_by_one():
    rows = np.arange(len(CLEAN))
    rows[-3:-1] += 1
    found = log_repair_of(with_pictures(rows))
    first, last = CLEAN.frame[-3], CLEAN.frame[-1]
    assert f"picture {first} is of pose {CLEAN.frame[-2]}" in only(found).physics
    assert f"pose {last} was taken twice" in only(found).physics
    np.testing.assert_allclose(found.views.base_from_flange, true_poses(rows))


def test_an_offset_of_more_than_half_of_the_frames_is_one_of_those_frames():
    rows = np.arange(len(CLEAN))
    rows[10:-1] += 1
    found = log_repair_of(with_pictures(rows))
    mixup = only(found)
    assert mixup.parameters["from_frame"][0] == CLEAN.frame[10]
    np.testing.assert_allclose(found.views.base_from_flange, true_poses(rows))


def test_a_pose_that_froze_is_reported_and_its_frames_are_left_out():
    poses = CLEAN.base_from_flange.copy()
    poses[12:20] = poses[11]
    found = log_repair_of(replace(CLEAN, base_from_flange=poses))
    assert only(found).name == "stale_poses"
    assert only(found).parameters["from_frame"][0] == CLEAN.frame[12]
    assert only(found).parameters["to_frame"][0] == CLEAN.frame[19]
    np.testing.assert_array_equal(found.views.frame, np.delete(CLEAN.frame, range(12, 20)))


def test_a_run_of_poses_that_fit_nothing_is_left_out_where_sound_frames_follow():
    rng = np.random.default_rng(3)
    poses = CLEAN.base_from_flange.copy()
    away = np.concatenate([rng.normal(0, 0.03, (5, 3)), rng.normal(0, 0.05, (5, 3))], axis=1)
    poses[12:17] = poses[12:17] @ rigid.from_vector(away)
    unknown = np.full_like(CLEAN.joints_rad, np.nan)
    found = log_repair_of(replace(CLEAN, base_from_flange=poses, joints_rad=unknown))
    assert [r.frame for r in found.rejected] == [int(f) for f in CLEAN.frame[12:17]]
    assert lost_frames(found.rejected, CLEAN.frame) is not None


@pytest.mark.parametrize("at", [9, 21])
@pytest.mark.parametrize("side", ["tool", "base"])
def test_a_tool_or_base_frame_that_was_set_midway_is_reported_with_frame_and_size(side, at):
    change = rigid.from_vector(np.array([0.01, -0.02, 0.12, 0.0, 0.3, 0.1]))
    poses = CLEAN.base_from_flange.copy()
    poses[at:] = poses[at:] @ change if side == "tool" else change @ poses[at:]
    unknown = np.full_like(CLEAN.joints_rad, np.nan)
    found = log_repair_of(replace(CLEAN, base_from_flange=poses, joints_rad=unknown))
    mixup = only(found)
    assert mixup.name == f"{side}_frame_step"
    assert mixup.alike == ("mount_slip" if side == "tool" else "board_slip",)
    assert mixup.parameters["at_frame"][0] == CLEAN.frame[at]
    np.testing.assert_allclose(found.views.base_from_flange, CLEAN.base_from_flange, atol=2e-3)


@pytest.mark.parametrize("side", ["tool", "base"])
def test_joints_tell_a_small_step_of_tool_or_base_frame_from_something_that_moved(side):
    change = rigid.from_vector(np.array([0.0, 1e-3, 4e-3, 0.0, 0.0, 1e-3]))
    poses = CLEAN.base_from_flange.copy()
    poses[12:] = poses[12:] @ change if side == "tool" else change @ poses[12:]
    found = log_repair_of(replace(CLEAN, base_from_flange=poses))
    assert only(found).name == f"{side}_frame_step"
    assert only(found).alike == ()
    assert only(found).parameters["at_frame"][0] == CLEAN.frame[12]
    np.testing.assert_allclose(found.views.base_from_flange, CLEAN.base_from_flange, atol=1e-4)


def test_corners_listed_by_columns_are_told_and_listed_by_rows():
    grid = np.arange(BOARD.corner_count).reshape(BOARD.rows, BOARD.cols)
    found = log_repair_of(replace(CLEAN, corners_px=CLEAN.corners_px[:, grid.T.ravel()]))
    assert only(found).name == "corner_order"
    assert "by columns" in only(found).physics
    np.testing.assert_array_equal(found.views.corners_px, CLEAN.corners_px)


def test_joints_in_degrees_are_read_as_such():
    found = log_repair_of(replace(CLEAN, joints_rad=np.rad2deg(CLEAN.joints_rad)))
    assert only(found).name == "angle_unit"
    np.testing.assert_allclose(found.views.joints_rad, CLEAN.joints_rad)


@pytest.mark.parametrize("turned", [[2], [1, 4]])
def test_the_sign_of_a_joint_is_found_from_the_poses(turned):
    joints = CLEAN.joints_rad.copy()
    joints[:, turned] *= -1.0
    found = log_repair_of(replace(CLEAN, joints_rad=joints))
    assert only(found).name == "joint_sign"
    assert set(only(found).parameters) == {f"joint_{joint + 1}" for joint in turned}
    np.testing.assert_allclose(found.views.joints_rad, CLEAN.joints_rad)


@pytest.mark.parametrize(("wrote", "took"), [("ZYX", "xyz"), ("XYZ", "xyz")])
def test_angles_written_in_another_order_than_they_were_read_are_reported(wrote, took):
    true = Rotation.from_matrix(CLEAN.base_from_flange[:, :3, :3])
    poses = CLEAN.base_from_flange.copy()
    poses[:, :3, :3] = Rotation.from_euler(took, true.as_euler(wrote)).as_matrix()
    found = log_repair_of(replace(CLEAN, base_from_flange=poses))
    assert only(found).name == "rotation_convention"
    np.testing.assert_allclose(found.views.base_from_flange, CLEAN.base_from_flange, atol=1e-9)


def test_poses_of_which_nobody_knows_who_carries_the_camera_leave_both_readings():
    found = log_repair_of(replace(CLEAN, base_from_flange=rigid.inverse(CLEAN.base_from_flange)))
    assert only(found).alike == ("mount",)


def test_a_single_position_in_another_unit_is_reported():
    poses = CLEAN.base_from_flange.copy()
    poses[[5, 6, 14], :3, 3] *= 1e3
    found = log_repair_of(replace(CLEAN, base_from_flange=poses))
    assert only(found).name == "length_unit"
    assert f"frame {CLEAN.frame[14]} is in millimetres" in only(found).physics
    np.testing.assert_allclose(found.views.base_from_flange, CLEAN.base_from_flange, atol=1e-12)


def test_mirrored_pictures_are_reported_and_set_right():
    corners = CLEAN.corners_px.copy()
    corners[..., 0] = CLEAN.width_px - 1.0 - corners[..., 0]
    found = log_repair_of(replace(CLEAN, corners_px=corners))
    assert only(found).name == "mirrored_pictures"
    np.testing.assert_allclose(found.views.corners_px, CLEAN.corners_px, atol=1e-9)


def test_frames_numbered_from_another_end_of_the_board_are_reported_and_renumbered():
    corners = CLEAN.corners_px.reshape(len(CLEAN), BOARD.rows, BOARD.cols, 2).copy()
    corners[4], corners[9] = corners[4, ::-1, ::-1], corners[9, :, ::-1]
    found = log_repair_of(replace(CLEAN, corners_px=corners.reshape(CLEAN.corners_px.shape)))
    assert only(found).name == "corner_order"
    assert f"frame {CLEAN.frame[9]}: columns run backwards" in only(found).physics
    np.testing.assert_allclose(found.views.corners_px, CLEAN.corners_px)
