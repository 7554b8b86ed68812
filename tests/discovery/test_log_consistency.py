"""Slips of the log are found, mended and named, and a clean log has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.kinematics import arm
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_repair import LogRepair, repair_log
from calib.views import Views
from cell.devices.log_mixups import _scalar_first, slip
from cell.storage.files.cell_file import EffectFile
from tests.discovery.simulated_runs import log, plain_cell, record

CLEAN = record(plain_cell(), log(30), seed=41)


def slipped(name: str, **parameters: float) -> Views:
    effect = EffectFile(name=name, parameters=parameters)
    return slip(CLEAN, effect, np.random.default_rng(3))


def books_of(views: Views) -> LogRepair:
    return repair_log(views, views)


def only(repaired: LogRepair) -> Mixup:
    (found,) = repaired.mixups
    return found


def test_a_clean_log_has_no_slip():
    repaired = books_of(CLEAN)
    assert repaired.mixups == ()
    assert repaired.rejected == ()
    assert len(repaired.views) == len(CLEAN)


@pytest.mark.parametrize("metres", [1e-3, 0.0254])
def test_a_unit_is_read_from_the_scale(metres):
    repaired = books_of(slipped("length_unit", metres_per_unit=metres))
    assert only(repaired).name == "length_unit"
    np.testing.assert_allclose(
        repaired.views.base_from_flange[:, :3, 3], CLEAN.base_from_flange[:, :3, 3], rtol=1e-9
    )


def test_a_scalar_first_quaternion_is_found():
    views = replace(CLEAN, base_from_flange=_scalar_first(CLEAN.base_from_flange))
    repaired = books_of(views)
    assert only(repaired).name == "rotation_convention"
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange, atol=1e-9)


def test_inverted_poses_are_found():
    repaired = books_of(replace(CLEAN, base_from_flange=rigid.inverse(CLEAN.base_from_flange)))
    assert only(repaired).name == "rotation_convention"
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange, atol=1e-9)


def test_a_pose_belonging_to_the_frame_before_is_found():
    repaired = books_of(slipped("frame_pose_offset", frames=1))
    assert only(repaired).name == "frame_pose_offset"
    assert abs(only(repaired).parameters["frames"][0]) == 1.0
    rows = np.searchsorted(CLEAN.frame, repaired.views.frame)
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange[rows])


def test_two_swapped_frames_are_named_and_set_right():
    views = slipped("frame_pose_swap", frames=2)
    swapped = np.flatnonzero(
        np.abs(views.base_from_flange - CLEAN.base_from_flange).max(axis=(1, 2)) > 0
    )
    assert len(swapped) == 2
    repaired = books_of(views)
    assert only(repaired).name == "frame_pose_swap"
    np.testing.assert_allclose(repaired.views.base_from_flange, CLEAN.base_from_flange)


def test_the_kinematics_of_another_arm_are_found():
    repaired = books_of(replace(CLEAN, base_from_flange=arm("ur5").forward(CLEAN.joints_rad)))
    assert only(repaired).name == "robot_model"


def test_one_wrong_pose_is_left_out_and_the_rest_is_used():
    poses = CLEAN.base_from_flange.copy()
    poses[7, :3, 3] += 0.05
    repaired = books_of(replace(CLEAN, base_from_flange=poses))
    assert [r.frame for r in repaired.rejected] == [int(CLEAN.frame[7])]
    assert len(repaired.views) == len(CLEAN) - 1
