"""A wide lens is recognised, and calibrated to the noise of its corners."""

import numpy as np
import pytest

from calib.calibration.lens_choice import chosen_lens
from calib.calibration.pipeline import calibrate
from calib.chain.optics import COLUMN
from tests.calibration.wide_scene import PINHOLE, WIDE, wide_views

FITTED = ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2", "k3", "k4")


@pytest.fixture(scope="module")
def found():
    return calibrate(wide_views())


def test_its_numbers_come_back_within_their_sigmas(found):
    joint = found.solutions["joint_ml"]
    assert joint.wide
    for name in FITTED:
        off = joint.values[name] - WIDE[COLUMN[name]]
        assert abs(off) < 4 * joint.sigma[name], name
    assert joint.sigma["alpha_px"] < 0.1
    assert 0.12 < joint.reprojection_px["rms"] < 0.16  # 0.1 px an axis
    assert found.robot.source == "joint"
    assert found.cross_validation.verdict == "agree"


def test_uncertainty_is_known_over_the_picture(found):
    sigma = found.uncertainty.projection_sigma_px
    assert np.isfinite(sigma).all()
    assert sigma.max() < 1.0
    assert np.isfinite(found.uncertainty.workpiece_sigma_m).all()


def test_the_paper_s_method_says_why_it_is_left_out(found):
    assert "equidistant" in found.missing["scale_factors"]
    assert found.zones is None


def test_corners_beyond_ninety_degrees_take_part():
    views = wide_views(widest_deg=95.0, frames=30, seed=5)
    enough = views.seen.sum(axis=1) >= 8
    baseline, homographies = chosen_lens(views)
    assert homographies is None
    assert (baseline.used == enough).all()
    for name in FITTED:
        off = baseline.mle.values[name] - WIDE[COLUMN[name]]
        assert abs(off) < 4 * baseline.mle.sigma[name], name
    assert np.degrees(baseline.mle.supported_rad(views.board.corners_m)) > 95.0


def test_a_wide_pinhole_stays_one():
    baseline, homographies = chosen_lens(wide_views(PINHOLE, widest_deg=45.0, frames=25))
    assert homographies is not None
    assert not baseline.mle.wide
