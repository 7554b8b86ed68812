"""A name stands where no law beats it and left-out frames want it; a smooth arm is a field."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.discovery.recordings import conceal
from benchmarks.discovery.run import views_of
from calib.chain.effect import Present
from calib.chain.effects import make_effect
from calib.chain.laws.arm_field import coordinates, present_field, rms
from calib.chain.model import predict
from calib.discovery.laws.arm_field import find_arm_field, scatters_too_much, with_arm_field
from calib.discovery.laws.cross_validation import CrossValidation
from calib.discovery.laws.frames import frame_blocks
from calib.discovery.laws.review import drop_unsupported, replaced_by_laws
from calib.discovery.log_repair import repair_log
from calib.discovery.search import Search, within_bounds
from calib.discovery.start import Fitter, fit_start
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(32)
SAG = make_effect("lens_sag", {})
BREATHING = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 5.0})


def searched(views: Views, *effects) -> Search:
    fitter = Fitter(views)
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    search.force(effects)
    return search


def names(search: Search) -> list[str]:
    return [present.effect.name for present in search.best.fit.model.effects]


def test_left_out_frames_want_what_is_there_and_nothing_else():
    search = searched(record(plain_cell().with_effects([BREATHING]), LOG, 11), BREATHING, SAG)
    fit = search.best.fit
    checked = CrossValidation(fit, frame_blocks(fit, search.views))
    breathing, sag = checked.without(0), checked.without(1)
    assert breathing.minus_two_log > 50.0
    assert breathing.gain_px > 0.1
    assert abs(sag.minus_two_log) < 5.0


def test_what_left_out_frames_do_not_want_is_dropped():
    clean = [searched(record(plain_cell(), LOG, seed), SAG) for seed in (12, 13, 14)]
    for search in clean:
        fit = search.best.fit
        wanted = CrossValidation(fit, frame_blocks(fit, search.views)).without(0).supported
        drop_unsupported(search)
        assert names(search) == (["lens_sag"] if wanted else [])
    assert min(len(names(search)) for search in clean) == 0


def test_a_name_that_a_law_beats_gives_its_place_to_the_law():
    gain_db = np.random.default_rng(5).choice([0.0, 6.0, 12.0], len(LOG))
    logged = replace(LOG, extra={"gain_db": gain_db})
    law = "linear:principal_point.u_px/gain_db"
    true = make_effect("empirical", {"law": law, "slope_u_px": 0.3, "low_1": 0.0, "high_1": 12.0})
    search = searched(record(plain_cell().with_effects([true]), logged, 15), SAG)
    (cell,) = replaced_by_laws(search)
    assert (cell.site, cell.covariate) == ("principal_point", "gain_db")
    assert names(search) == ["empirical"]


def test_a_true_name_keeps_its_place():
    search = searched(record(plain_cell().with_effects([BREATHING]), LOG, 16), BREATHING)
    assert replaced_by_laws(search) == []
    assert names(search) == ["focus_breathing"]


def test_an_amount_at_the_end_of_its_range_makes_no_name():
    window = make_effect("protective_window", {"thickness_m": 0.02})
    fit = Fitter(record(plain_cell(), LOG, 17)).fit(plain_cell(), NOISE)
    assert not within_bounds(
        replace(fit, model=fit.model.with_effects([window])), "protective_window"
    )
    thin = replace(window, values=np.array([0.004]))
    assert within_bounds(replace(fit, model=fit.model.with_effects([thin])), "protective_window")


def smooth_arm(*others: Present) -> Views:
    """An arm that errs smoothly over its joints by some tenths of a millimetre."""
    nodes = coordinates(LOG, "joints")
    weights = np.random.default_rng(18).normal(0.0, 1.0, (len(nodes), 6))
    weights *= np.array([2e-4] * 3 + [4e-4] * 3)
    field = present_field("joints", nodes, weights, 1.2, 1.0)
    return record(plain_cell().with_effects([*others, field]), LOG, 19)


def test_an_arm_that_errs_smoothly_over_its_joints_is_reported_and_a_sound_one_is_not():
    views = smooth_arm()
    found = find_arm_field(Fitter(views).fit(plain_cell(), NOISE), views)
    assert found is not None
    assert found.gain > 14.0
    given = found.present.as_mapping()
    assert abs(np.log(given["length_scale"] / 1.2)) < 1.0
    assert 0.0 < given["length_scale_sigma"] < given["length_scale"]
    assert 0.0 < given["share_sigma"] < 0.5
    assert 0.0 < given["rms_sigma_m"] < 0.3 * rms(found.present)[0]


def test_names_that_soak_up_a_smooth_arm_give_way_to_its_field_and_a_true_one_stays():
    slip = make_effect("board_slip", {"at_frame": 16})
    search = searched(smooth_arm(), slip, make_effect("joint_compliance", {}))
    (cell,) = with_arm_field(search)
    assert (cell.site, cell.covariate) == ("flange_pose", "joints")
    assert names(search) == ["empirical"]
    search = searched(smooth_arm(BREATHING), BREATHING, slip)
    assert len(with_arm_field(search)) == 1
    assert names(search) == ["focus_breathing", "empirical"]


def test_an_arm_that_scatters_much_without_a_pattern_makes_no_field():
    loose = replace(NOISE, flange_m=6e-4, flange_rad=1.5e-3)
    views = record(plain_cell(), LOG, 21, loose)
    fit = Fitter(views).fit(plain_cell(), loose)
    assert find_arm_field(fit, views) is None
    assert scatters_too_much(fit)
    sound = record(plain_cell(), LOG, 20)
    assert find_arm_field(Fitter(sound).fit(plain_cell(), NOISE), sound) is None


def test_a_field_comes_back_from_its_file_and_is_nothing_far_from_its_nodes():
    nodes = coordinates(LOG, "joints")[:4]
    weights = np.full((4, 6), 1e-3)
    field = present_field("joints", nodes, weights, 0.5, 0.9)
    again = make_effect("empirical", {"law": field.effect.law or "", **field.as_mapping()})
    model = plain_cell()
    reported = predict(model.with_effects([again]), LOG)
    np.testing.assert_array_equal(reported, predict(model.with_effects([field]), LOG))
    near = np.abs(reported - predict(model, LOG)).max(axis=(1, 2))
    away = np.linalg.norm(coordinates(LOG, "joints")[:, None] - nodes, axis=2).min(axis=1)
    assert near[:4].min() > 0.5
    assert near[away > 2.5].max(initial=0.0) < 0.05


def test_corners_that_err_alike_in_a_picture_make_no_name():
    """Their likelihood counts every corner; the frames left out do not all gain by the name."""
    case = conceal("clean 7")
    views = views_of(case, np.flatnonzero(~case.ahead))
    repaired = repair_log(views, views)
    every = np.ones(len(views), dtype=bool)
    fitter = Fitter(repaired.views)
    start = fit_start(fitter, repaired.free, every)
    search = Search(start, fitter)
    search.force([make_effect("joint_zero_offset", {}), make_effect("board_shear", {})])
    fit = search.best.fit
    shear = CrossValidation(fit, frame_blocks(fit, search.views)).without(1)
    assert shear.minus_two_log > 10.0
    assert not shear.supported
    drop_unsupported(search)
    assert "board_shear" not in names(search)
