"""What a plan would reveal, against fits of recordings made by that plan."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from calib.chain.effect import Present
from calib.chain.effects import find_effect, make_effect
from calib.discovery.design.power import alike, plan_power
from calib.distributions import noncentrality
from calib.solver.joint import fit_joint
from calib.solver.unknowns import unknowns_of
from cell.cli.app import app
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

CONFIGS = Path(__file__).parents[2] / "configs"
PLAN = log(30)
POWER = plan_power(plain_cell(), PLAN, NOISE)
BY_LABEL = {e.effect.label: e for e in POWER.effects}


def test_noncentrality_is_the_one_of_a_two_sided_normal_test():
    assert noncentrality(1, 0.05, 0.9) == pytest.approx((1.95996 + 1.28155) ** 2, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "parameter", "amount"),
    [
        ("focus_breathing:inverse_square", "k_px_m2", 0.5),
        ("mount_flex", "rad_per_g", 5e-4),
        ("board_scale", "relative", 1e-3),
    ],
)
def test_the_smallest_size_follows_from_the_sigma_that_a_fit_has(name, parameter, amount):
    label, _, law = name.partition(":")
    present = make_effect(label, {parameter: amount, **({"law": law} if law else {})})
    model = plain_cell().with_effects([present])
    views = record(model, PLAN, seed=5)
    fit = fit_joint(model, views, unknowns_of(model), NOISE, fixed_noise=True)
    power = BY_LABEL[name]
    expected = np.sqrt(power.needed) * fit.sigma(f"{name}.{parameter}")
    assert power.limits[0].smallest == pytest.approx(expected, rel=0.03)


def test_an_effect_of_the_smallest_size_is_found_nine_times_in_ten():
    """Monte Carlo on the whole chain: the fitted amount, over its sigma, against the threshold."""
    power = BY_LABEL["thermal_focal_drift"]
    smallest = power.limits[0].smallest
    assert smallest is not None
    effect = find_effect("thermal_focal_drift")
    present = Present(effect, effect.values({"relative": smallest}))
    truth = plain_cell().with_effects([present])
    unknowns = [u for u in unknowns_of(truth) if not u.name.endswith("tau_s")]
    scores = []
    for seed in range(24):
        fit = fit_joint(
            truth, record(truth, PLAN, seed), tuple(unknowns), NOISE, rounds=1, fixed_noise=True
        )
        name = "thermal_focal_drift.relative"
        scores.append(fit.model.effects[0].values[0] / fit.sigma(name))
    expected = np.sqrt(power.needed)
    assert np.mean(scores) == pytest.approx(expected, abs=3.5 / np.sqrt(24))
    assert 0.5 < np.std(scores) < 1.6


def test_mirror_images_are_reported_with_the_experiment_that_parts_them():
    pairs = {frozenset((e.effect.label, r.label)): r for e, r in alike(POWER)}
    scale = pairs[frozenset({"board_scale", "link_geometry"})]
    assert scale.mirror
    assert "calliper" in scale.experiment
    assert frozenset({"board_warp", "joint_zero_offset"}) not in pairs


def test_what_does_not_move_cannot_show_a_clock():
    assert set(POWER.unseen) == {"exposure_bias", "pose_time_lag", "rolling_shutter"}
    moving = plan_power(plain_cell(), log(30, moving=True), NOISE)
    assert {"pose_time_lag", "rolling_shutter"} <= {e.effect.name for e in moving.effects}


def test_more_noise_of_the_arm_hides_the_arm_and_leaves_the_board():
    worse = plan_power(plain_cell(), PLAN, type(NOISE)(NOISE.corner_px, 3e-4, 1e-3))
    by_label = {e.effect.label: e for e in worse.effects}

    def growth(label):
        return by_label[label].limits[0].smallest / BY_LABEL[label].limits[0].smallest

    assert growth("joint_zero_offset") > 3.0
    assert growth("board_warp") < 1.6


def test_the_verb_reports_it_of_a_cell_and_of_a_plan():
    run = CliRunner().invoke
    plan = run(app, ["plan", "--power", str(CONFIGS / "ur3-robotiq.plan.yaml"), "--json"])
    reported = json.loads(plan.stdout)
    assert reported["noise"]["from"] == "simulation.noise"
    effects = {(e["name"], e["law"]): e for e in reported["effects"]}
    assert effects["focus_breathing", "inverse_square"]["smallest"]["k_px_m2"]["value"] > 0
    names = [set(pair["names"]) for pair in reported["not_told_apart"]]
    assert {"entrance_pupil_shift", "protective_window"} in names
    text = run(app, ["plan", "--power", str(CONFIGS / "ur3-robotiq.plan.yaml")])
    assert text.exit_code == 0
    assert "could not be distinguished" in text.stdout


def test_a_cell_without_anything_of_its_layout_is_refused_in_words(tmp_path):
    whole = (CONFIGS / "ur3-robotiq.cell.yaml").read_text()
    path = tmp_path / "bare.cell.yaml"
    path.write_text(whole[: whole.index("layout:")])
    result = CliRunner().invoke(app, ["plan", "--power", str(path)])
    assert result.exit_code != 0
    assert "layout" in str(result.exception)
