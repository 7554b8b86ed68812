from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calib.calibration.baseline import fit_baseline
from calib.calibration.frames import usable_frames
from calib.calibration.pipeline import calibrate
from calib.calibration.robot import hand_eye_of
from calib.views import Views
from cell.calibrate import corners_of, same_order_everywhere
from cell.files.plan_file import read_plan
from cell.recording import read_recording
from cell.simulate import simulate_corners

PLAN = Path(__file__).parents[2] / "configs" / "irb140-eosens-by-hand.plan.yaml"


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Views:
    folder = tmp_path_factory.mktemp("by-hand") / "recording"
    simulate_corners(read_plan(PLAN), folder, seed=2)
    recording = read_recording(folder)
    return same_order_everywhere(recording.views(corners_of(recording)))


def test_a_frame_that_only_the_wrong_lens_accuses_is_taken_back(views: Views) -> None:
    baseline = fit_baseline(views, usable_frames(views))
    hand = hand_eye_of(views, baseline.used, baseline.mle.camera_from_board)
    assert views.frame[~hand.used].tolist() == [21], "hand-eye alone accuses nobody here any more"
    found = calibrate(views)
    assert found.robot is not None
    assert found.robot.outliers == ()


def test_frames_with_each_others_poses_stay_out(views: Views) -> None:
    flange = views.base_from_flange.copy()
    flange[[21, 30]] = flange[[30, 21]]
    found = calibrate(replace(views, base_from_flange=flange))
    assert found.robot is not None
    assert found.robot.outliers == (21, 30)
