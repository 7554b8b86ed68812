"""Physics by another author's equation: the name is the same, and so are the twin's predictions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain.covariates import covariate_named
from calib.chain.effects import make_effect
from calib.chain.empirical import Curve, present_curve, site_named
from calib.chain.model import evaluate
from calib.discovery.residual_structure import find_residual_structure
from calib.discovery.search import Search, criterion
from calib.discovery.start import Fitter
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(40)


def searched(views: Views) -> Search:
    fitter = Fitter(views)
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    search.run()
    return search


def names(views: Views) -> list[str]:
    """What is named; nothing must be left over."""
    found = find_residual_structure(searched(views))
    assert found.cells == ()
    return [present.effect.name for present in found.search.best.fit.model.effects]


def test_a_focal_length_that_turns_back_with_the_distance_is_focus_breathing():
    curve = Curve(site_named("focal_length"), covariate_named("distance"), 0.36, 0.9)
    state = evaluate(plain_cell(), LOG)
    bent = present_curve(curve, state)
    bent.values[1] = 4e-3  # the second Legendre function: the same at both ends
    assert names(record(plain_cell().with_effects([bent]), LOG, seed=51)) == ["focus_breathing"]


@pytest.mark.parametrize("name", ["thermal_focal_drift", "thermal_mount_drift"])
def test_a_drift_found_in_some_frames_holds_for_the_others(name):
    amount = "relative" if name == "thermal_focal_drift" else "x_m"
    drift = make_effect(name, {amount: 1e-3, "tau_s": 200.0, "start_s": float(LOG.t_s[0])})
    model = plain_cell().with_effects([drift])
    late = np.arange(20, 40)
    every, some = evaluate(model, LOG), evaluate(model, LOG.take(late))
    np.testing.assert_allclose(some.optics, every.optics[late])
    np.testing.assert_allclose(some.camera_from_board, every.camera_from_board[late])


def test_a_clock_that_counts_from_elsewhere_changes_nothing():
    drift = make_effect("thermal_focal_drift", {"relative": 1.5e-3, "tau_s": 200.0})
    views = record(plain_cell().with_effects([drift]), LOG, seed=53)
    assert names(replace(views, t_s=views.t_s + 1.7e9)) == ["thermal_focal_drift"]


def test_picking_among_many_shapes_is_paid_for_as_long_as_the_effect_stays():
    slip = make_effect("board_slip", {"x_m": 1e-3, "at_frame": 18.0})
    views = record(plain_cell().with_effects([slip]), LOG, seed=54)
    search = searched(views)
    (step,) = search.steps
    assert step.taken.effect.name == "board_slip"
    paid = search.best.criterion - criterion(search.best.fit, views)
    assert paid > 2.0 * np.log(30)


@pytest.mark.parametrize("part", ["_lever_x", "_turn"])
def test_a_bracket_that_turns_about_another_axis_is_still_flex(part):
    flex = make_effect("mount_flex", {"rad_per_g": 3e-4, f"rad_per_g{part}": 6e-4})
    views = record(plain_cell().with_effects([flex]), LOG, seed=55)
    assert names(views) == ["mount_flex"]


def test_play_in_one_joint_is_seen_at_a_size_at_which_six_would_not_be():
    play = make_effect("joint_backlash", {"play_rad_3": 8e-5})
    search = searched(record(plain_cell().with_effects([play]), LOG, seed=56))
    (present,) = search.best.fit.model.effects
    assert present.effect.name == "joint_backlash"
    fitted = {present.effect.parameters[k].name for k in present.free}
    assert "play_rad_3" in fitted
    assert len(fitted) < 4
