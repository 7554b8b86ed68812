"""The paper's finding on the plan that comes along: fits well, and lies by centimetres."""

from pathlib import Path

import numpy as np

from calib.calibration import Statistics, calibrate
from calib.chain.model import evaluate
from calib.handeye import camera_position_error_m
from cell.storage.files.plan_file import read_plan
from sim.log import tour
from sim.presets import irb140_eosens
from sim.synthesize import synthesize

PLAN = Path(__file__).parents[2] / "configs" / "irb140-eosens-by-hand.plan.yaml"


def test_zhang_fits_well_and_is_centimetres_off_where_the_fixed_alpha_fit_is_right() -> None:
    cell = irb140_eosens(seed=3)
    joints = np.radians([view.joints_deg for view in read_plan(PLAN).file.views])
    log = tour(cell, joints)
    found = calibrate(synthesize(cell, log))
    truth = evaluate(cell.model, log).camera_from_board

    def error(name: str) -> Statistics:
        poses = found.solutions[name].camera_from_board
        return Statistics.of(camera_position_error_m(poses, truth))

    assert found.solutions["zhang_mle"].reprojection_px["rms"] < 0.3
    assert error("zhang_mle").mean[2] > 0.015
    assert error("zhang_mle").rms > 0.020
    assert error("fixed_alpha_mle").rms < 0.0005
    assert error("joint_ml").rms < 0.0005
