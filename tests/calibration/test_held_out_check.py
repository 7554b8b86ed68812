from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calib.calibration.baseline import fit_baseline
from calib.calibration.frames import usable_frames
from calib.calibration.pipeline import calibrate
from calib.calibration.robot import hand_eye_of
from calib.detection.same_order import same_order_everywhere
from calib.views import Views
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.recording import read_recording
from cell.storage.recording.detect import corners_of
from cell.verbs.simulate import simulate_corners

PLAN = Path(__file__).parents[2] / "configs" / "irb140-eosens-by-hand.plan.yaml"


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Views:
    folder = tmp_path_factory.mktemp("by-hand") / "recording"
    simulate_corners(_with_a_lens_that_moves_more(read_plan(PLAN)), folder, seed=2)
    recording = read_recording(folder)
    return same_order_everywhere(recording.views(corners_of(recording)))


def _with_a_lens_that_moves_more(plan: Plan) -> Plan:
    assert plan.cell.simulation is not None
    lens = plan.cell.simulation.effects[0].model_copy(update={"parameters": {"k_px_m2": 90.0}})
    truth = plan.cell.simulation.model_copy(update={"effects": (lens,)})
    return replace(plan, cell=plan.cell.model_copy(update={"simulation": truth}))


def test_frames_that_only_the_wrong_lens_accuses_are_taken_back(views: Views) -> None:
    baseline = fit_baseline(views, usable_frames(views))
    hand = hand_eye_of(views, baseline.used, baseline.mle.camera_from_board)
    suspected = views.frame[~hand.used].tolist()
    assert {15, 28} <= set(suspected), "hand-eye alone accuses nobody here any more"
    found = calibrate(views)
    assert found.robot is not None
    assert found.robot.outliers == ()


def test_frames_with_each_others_poses_stay_out(views: Views) -> None:
    flange = views.base_from_flange.copy()
    flange[[21, 30]] = flange[[30, 21]]
    found = calibrate(replace(views, base_from_flange=flange))
    assert found.robot is not None
    assert found.robot.outliers == (21, 30)
