"""The whole diagnosis: nothing where nothing is, names where they are, and an honest don't-know."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.effects import make_effect
from calib.chain.model import CellModel, predict
from calib.discovery.diagnose import diagnose
from calib.discovery.log_repair import repair_log
from calib.solver.noise import Noise
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

pytestmark = pytest.mark.slow

LOG = log(32)
CLEAN = record(plain_cell(), LOG, seed=21)


def recorded(*effects, seed=1) -> Views:
    return record(plain_cell().with_effects(effects), LOG, seed)


def names(diagnosis) -> set[str]:
    return {effect.name for effect in diagnosis.effects}


@pytest.mark.parametrize("scatter", [1.0, 3.0])
def test_a_clean_recording_is_consistent_whatever_the_arm_scatters(scatter):
    noise = Noise(NOISE.corner_px, scatter * NOISE.flange_m, scatter * NOISE.flange_rad)
    found = diagnose(record(plain_cell(), LOG, seed=22, noise=noise))
    assert found.verdict == "consistent"
    assert found.effects == ()
    assert found.unexplained is None
    assert found.twin.noise.corner_px == pytest.approx(noise.corner_px, rel=0.08)
    assert found.twin.noise.flange_m == pytest.approx(noise.flange_m, rel=0.5)
    assert found.proof is not None
    assert found.proof.rms_px_after == pytest.approx(found.proof.noise_px, rel=0.5)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("focus_breathing", {"law": "inverse_square", "k_px_m2": 8.0}),
        ("joint_zero_offset", {"offset_rad_3": 8e-4}),
        ("board_warp", {"bend_x_m": 3e-4}),
    ],
)
def test_one_effect_is_named_measured_and_proved(name, values):
    present = make_effect(name, values)
    found = diagnose(recorded(present))
    assert found.verdict == "explained"
    assert names(found) == {name}
    (effect,) = found.effects
    assert effect.law == values.get("law")
    assert effect.p_value < 1e-6
    for parameter, value in values.items():
        if parameter != "law":
            reported = effect.parameters[parameter]
            assert abs(reported.value - value) < 3.5 * reported.sigma
    assert found.proof is not None
    assert found.proof.rms_px_after < found.proof.rms_px_before
    # odds of the held-out frames, all together: the plain cell's larger noise hides some of it
    log_odds = (found.proof.nll_before - found.proof.nll_after) * len(found.proof.frames)
    assert log_odds > 5.0
    assert found.mismatch[0].p_value < 1e-3


def test_two_effects_at_once_are_both_named_and_predict_poses_never_shown():
    effects = (
        make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 8.0}),
        make_effect("joint_compliance", {"rad_per_Nm_2": 2e-5, "rad_per_Nm_3": 2e-5}),
    )
    found = diagnose(recorded(*effects))
    assert names(found) == {"focus_breathing", "joint_compliance"}
    ahead = log(12, seed=91)
    true = predict(plain_cell().with_effects(effects), ahead)

    def miss(model: CellModel) -> float:
        return float(np.sqrt(np.mean((predict(model, ahead) - true) ** 2)))

    assert miss(found.twin.model) < 0.15
    assert miss(found.twin.model) < 0.2 * miss(found.plain.model)


def swaying() -> Views:
    """A base that sways by 0.6 mm every 97 s: no effect of the catalogue does that."""
    sway = np.zeros((len(LOG), 6))
    sway[:, 0] = 6e-4 * np.sin(2 * np.pi * LOG.t_s / 97.0)
    moved = replace(LOG, base_from_flange=rigid.from_vector(sway) @ LOG.base_from_flange)
    made = record(plain_cell(), moved, seed=31)
    return replace(made, base_from_flange=LOG.base_from_flange[made.frame])


def dented() -> Views:
    """A dent in the window before the sensor: corners shift near one place of the image."""
    made = record(plain_cell(), LOG, seed=32)
    off = made.corners_px - np.array([1300.0, 600.0])
    fall = np.exp(-0.5 * (off**2).sum(axis=2, keepdims=True) / 180.0**2)
    return replace(made, corners_px=made.corners_px + 1.5 * off / 180.0 * fall)


@pytest.mark.parametrize(
    ("views", "links"),
    [(swaying, {"arm", "board"}), (dented, {"sensor", "lens"})],
)
def test_physics_of_no_catalogue_is_unexplained_and_placed(views, links):
    found = diagnose(views())
    assert found.verdict == "unexplained"
    assert found.unexplained is not None
    assert found.unexplained.link in links
    assert found.unexplained.p_value < 1e-4
    assert {effect.link for effect in found.effects} <= links


def without(*columns: str) -> Views:
    return replace(CLEAN, **{name: np.full_like(getattr(CLEAN, name), np.nan) for name in columns})


def test_joints_that_were_not_logged_are_worked_out_and_that_is_reported():
    bare = without("joints_rad", "joint_velocity_rad_s", "approach_joints_rad")
    repaired = repair_log(bare, bare)
    assert np.isfinite(repaired.views.joints_rad).all()
    assert "joints" in " ".join(repaired.notes)


def test_without_times_what_drifts_is_reported_as_out_of_sight():
    found = diagnose(without("t_s", "temperature_c"))
    assert found.verdict == "consistent"
    notes = " ".join(found.notes)
    assert "t_s was not logged" in notes
    assert "thermal_focal_drift" in notes


def test_without_poses_the_board_can_still_be_judged():
    warped = recorded(make_effect("board_warp", {"bend_x_m": 3e-4}))
    unheard = replace(
        warped,
        base_from_flange=np.full_like(warped.base_from_flange, np.nan),
        joints_rad=np.full_like(warped.joints_rad, np.nan),
        joint_velocity_rad_s=np.full_like(warped.joints_rad, np.nan),
        approach_joints_rad=np.full_like(warped.joints_rad, np.nan),
        robot_model=None,
    )
    found = diagnose(unheard)
    assert "no robot poses" in " ".join(found.notes)
    assert names(found) == {"board_warp"}
