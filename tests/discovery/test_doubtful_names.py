"""Names that rest on little are not reported: beside a dent, and on branches that were guessed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.covariates import covariate_named
from calib.chain.effects import make_effect
from calib.chain.empirical import Curve, present_curve, site_named
from calib.chain.model import evaluate, kinematics_of
from calib.discovery.fields import field_scores
from calib.discovery.log_consistency.branches import Branches, choose_branches
from calib.discovery.log_repair import repair_log
from calib.discovery.search import Search
from calib.discovery.start import Fitter, fit_start
from calib.solver.noise import Noise
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(30)
WARP = make_effect("board_warp", {"bend_x_m": 8e-4})
WINDOW = make_effect("protective_window", {})


def widely_dented() -> Views:
    """A bent board, and a dent a quarter of the picture wide in what the sensor shows."""
    made = record(plain_cell().with_effects([WARP]), LOG, seed=61)
    off = made.corners_px - np.array([1450.0, 1000.0])
    fall = np.exp(-0.5 * (off**2).sum(axis=2, keepdims=True) / 250.0**2)
    return replace(made, corners_px=made.corners_px + 2.0 * off / 250.0 * fall)


def test_a_lens_effect_that_fits_the_edge_of_a_dent_loses_its_name_and_a_bent_board_keeps_it():
    fitter = Fitter(widely_dented())
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    search.force([WARP, WINDOW])
    field = field_scores(search.best.fit, fitter.views)[0]
    assert field.score.p_value < 1e-20
    search.drop_beside_field(field.site, field.score.gain)
    assert [p.effect.name for p in search.best.fit.model.effects] == ["board_warp"]


def branches_of(views: Views) -> tuple[Views, Branches]:
    nothing = np.full_like(views.joints_rad, np.nan)
    bare = replace(
        views,
        joints_rad=nothing,
        joint_velocity_rad_s=nothing,
        approach_joints_rad=nothing,
    )
    repaired = repair_log(bare, bare)
    kinematics = kinematics_of(repaired.views)
    assert kinematics is not None
    fit = fit_start(Fitter(repaired.views), repaired.free, np.ones(len(repaired.views), dtype=bool))
    return repaired.views, choose_branches(fit, repaired.views, kinematics)


def test_a_sound_arm_without_joints_keeps_the_branches_that_were_guessed_first():
    first, chosen = branches_of(record(plain_cell(), LOG, seed=62))
    np.testing.assert_array_equal(chosen.joints_rad, first.joints_rad)
    assert chosen.price == 0.0


def test_a_faulty_arm_without_joints_is_put_on_its_true_branches_at_a_price():
    offset = make_effect("joint_zero_offset", {"offset_rad_2": 2e-3, "offset_rad_3": -2e-3})
    quiet = Noise(corner_px=0.03, flange_m=4e-6, flange_rad=1e-5)
    made = record(plain_cell().with_effects([offset]), LOG, seed=63, noise=quiet)
    _, chosen = branches_of(made)
    true = LOG.joints_rad[np.searchsorted(LOG.frame, made.frame)]
    turn = np.abs(np.sin(0.5 * (chosen.joints_rad - true))).max(axis=1)
    assert np.mean(turn < 1e-2) > 0.9
    assert chosen.price > 20.0


def test_a_wave_loses_its_name_where_its_joint_needs_a_curve_besides():
    wave = make_effect("joint_periodic_error", {"sin_rad_3": 3e-4, "cycles_per_turn": 1.0})
    fitter = Fitter(record(plain_cell().with_effects([wave]), LOG, seed=64))
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    search.force([wave])
    search.drop_on_joints(set())
    assert [p.effect.name for p in search.best.fit.model.effects] == ["joint_periodic_error"]
    search.drop_on_joints({"joint_3"})
    assert search.best.fit.model.effects == ()


def test_play_loses_its_name_where_its_joint_needs_a_curve_besides():
    play = make_effect("joint_backlash", {"play_rad_3": 3e-4})
    fitter = Fitter(record(plain_cell().with_effects([play]), LOG, seed=67))
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    search.force([replace(play, held=frozenset(range(6)) - {2})])
    search.drop_on_joints({"joint_2"})
    assert [p.effect.name for p in search.best.fit.model.effects] == ["joint_backlash"]
    search.drop_on_joints({"joint_3"})
    assert search.best.fit.model.effects == ()


def test_a_sag_keeps_its_name_for_the_joints_that_need_no_curve():
    sag = make_effect("joint_compliance", {"rad_per_Nm_2": 3e-5, "rad_per_Nm_4": 1e-4})
    fitter = Fitter(record(plain_cell().with_effects([sag]), LOG, seed=65))
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    search.force([sag])
    search.drop_on_joints({"joint_4"})
    (left,) = search.best.fit.model.effects
    assert left.effect.name == "joint_compliance"
    values = left.as_mapping()
    assert values["rad_per_Nm_4"] == 0.0
    assert values["rad_per_Nm_2"] != 0.0


def beside_a_drag_of_the_wrist(sag_rad_per_Nm: float, decentering: float) -> list[str]:
    """Names left where the fifth joint follows the sixth: a curve carries the drag."""
    true = [
        make_effect("joint_compliance", {"rad_per_Nm_2": sag_rad_per_Nm}),
        make_effect("decentering", {"p1": decentering}),
    ]
    low, high = LOG.joints_rad[:, 5].min(), LOG.joints_rad[:, 5].max()
    curve = Curve(site_named("joint_5"), covariate_named("joint_6"), low, high)
    empty = present_curve(curve, evaluate(plain_cell(), LOG))
    bent = replace(empty, values=1e-3 * np.sin(np.arange(len(empty.values))))
    fitter = Fitter(record(plain_cell().with_effects([bent, *true]), LOG, seed=66))
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    assert search.put_in(empty)
    search.force([*search.best.fit.model.effects, *true])
    search.drop_beside_curves()
    return [p.effect.name for p in search.best.fit.model.effects]


def test_beside_a_curve_a_name_of_its_link_must_gain_a_share_of_what_the_curve_does():
    assert beside_a_drag_of_the_wrist(1e-6, 1e-3) == ["empirical", "decentering"]
    assert beside_a_drag_of_the_wrist(1e-4, 1e-5) == [
        "empirical",
        "joint_compliance",
        "decentering",
    ]
