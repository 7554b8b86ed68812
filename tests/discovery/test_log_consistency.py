"""Mix-ups in the log are found, mended and named, and a clean log has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.kinematics import arm
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_repair import LogRepair, repair_log
from calib.views import FloatArray, Views
from cell.devices.log_mixups import _scalar_first, slip
from cell.storage.files.cell_file import EffectFile
from tests.discovery.simulated_runs import log, plain_cell, record

CLEAN = record(plain_cell(), log(30), seed=41)


def mixed_up(name: str, **parameters: float) -> Views:
    effect = EffectFile(name=name, parameters=parameters)
    return slip(CLEAN, effect, np.random.default_rng(3))


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
def test_a_run_of_stale_pictures_is_told_with_where_it_starts_and_ends(late):
    rows = np.arange(len(CLEAN))
    rows[8:21] -= late
    found = log_repair_of(with_pictures(rows))
    mixup = only(found)
    assert mixup.name == "stale_pictures"
    assert mixup.parameters["from_frame"][0] == CLEAN.frame[8]
    assert mixup.parameters["to_frame"][0] == CLEAN.frame[20]
    assert f"from frame {CLEAN.frame[8]} to {CLEAN.frame[20]}" in mixup.physics
    np.testing.assert_allclose(found.views.base_from_flange, true_poses(rows))


def test_a_picture_that_was_written_twice_is_told():
    rows = np.arange(len(CLEAN))
    rows[12] = 11
    found = log_repair_of(with_pictures(rows))
    mixup = only(found)
    assert mixup.name == "stale_pictures"
    assert f"pose {CLEAN.frame[11]} was taken twice" in mixup.physics
    np.testing.assert_allclose(found.views.base_from_flange, true_poses(rows))


def test_pictures_that_ran_ahead_at_the_end_are_told_one_by_one():
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
