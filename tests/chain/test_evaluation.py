"""The chain evaluated: mounts, distances, order of the effects, curves without a name."""

from dataclasses import replace

import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.covariates import COVARIATES, covariate_named, covariates_of
from calib.chain.effect import Present
from calib.chain.effects import make_effect
from calib.chain.empirical import (
    SITES,
    Curve,
    empirical,
    present_curve,
    site_named,
    span,
)
from calib.chain.model import Errors, evaluate, predict
from calib.chain.optics import COLUMN
from calib.views import Mount
from tests.chain.cells import cell, mirrored


def test_the_chain_closes_for_an_eye_in_hand() -> None:
    model, views = cell()
    state = evaluate(model, views)
    camera = views.base_from_flange @ model.flange_from_mounted
    assert np.allclose(camera @ state.camera_from_board, model.base_from_fixed, atol=1e-12)


def test_a_fixed_eye_is_an_eye_in_hand_with_base_and_flange_exchanged() -> None:
    model, views = cell("eye_to_hand")
    exchanged = replace(
        model,
        flange_from_mounted=model.base_from_fixed,
        base_from_fixed=model.flange_from_mounted,
    )
    assert np.allclose(
        predict(model, views), predict(exchanged, replace(mirrored(views), robot_model=None))
    )


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_the_distance_is_the_depth_of_the_board_s_middle(mount: Mount) -> None:
    model, views = cell(mount)
    state = evaluate(model, views)
    board = views.board
    middle = np.array([(board.cols - 1) / 2, (board.rows - 1) / 2, 0.0]) * board.square_m
    depth = [(pose[:3, :3] @ middle + pose[:3, 3])[2] for pose in state.camera_from_board]
    assert np.allclose(state.distance_m, depth)
    assert np.allclose(state.focused_m, depth)
    logged = np.where(np.arange(len(views)) < 3, 0.4, np.nan)
    focused = evaluate(model, replace(views, focus_distance_m=logged)).focused_m
    assert np.allclose(focused, np.where(np.isfinite(logged), 0.4, depth))


def test_breathing_follows_the_stated_laws() -> None:
    model, views = cell()
    distance = evaluate(model, views).distance_m
    alpha = model.optics[COLUMN["alpha_px"]]
    square = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 18.0})
    found = evaluate(model.with_effects([square]), views)
    assert np.allclose(found.column("alpha_px"), alpha - 18.0 / distance**2)
    thin = make_effect("focus_breathing", {"law": "thin_lens", "f_m": 0.018})
    found = evaluate(model.with_effects([thin]), views)
    assert np.allclose(found.column("alpha_px"), alpha * distance / (distance - 0.018))
    ratio = found.column("beta_px") / found.column("alpha_px")
    assert np.allclose(ratio, model.optics[COLUMN["beta_px"]] / alpha)


def test_the_flange_error_stands_in_the_flange_s_own_frame() -> None:
    model, views = cell()
    error = np.random.default_rng(1).normal(0, 1e-3, (len(views), 6))
    moved = replace(views, base_from_flange=views.base_from_flange @ rigid.from_vector(error))
    assert np.allclose(predict(model, views, errors=Errors(error)), predict(model, moved))


def test_the_order_in_which_effects_are_listed_does_not_matter() -> None:
    model, views = cell()
    effects = [
        make_effect("board_scale", {"relative": 0.01}),
        make_effect("focus_breathing", {"law": "thin_lens", "f_m": 0.02}),
        make_effect("joint_zero_offset", {"offset_rad": [0, 0.01, 0, 0, 0.01, 0]}),
        make_effect("mount_flex", {"rad_per_g": 0.002}),
    ]
    forth = predict(model.with_effects(effects), views)
    assert np.array_equal(forth, predict(model.with_effects(effects[::-1]), views))


def test_a_moved_joint_keeps_the_factory_calibration_in_the_logged_pose() -> None:
    model, views = cell()
    own = rigid.from_vector(np.array([1e-3, 2e-3, -1e-3, 1e-3, 0.0, 2e-3]))
    calibrated = replace(views, base_from_flange=own @ views.base_from_flange)
    offset = make_effect("joint_zero_offset", {"offset_rad": [0, 0, 0.01, 0, 0, 0]})
    moved = evaluate(model.with_effects([offset]), calibrated)
    plain = evaluate(model.with_effects([offset]), views)
    assert moved.arm is not None
    nominal = moved.arm.forward(views.joints_rad)
    turned = rigid.inverse(nominal) @ plain.base_from_flange
    assert np.allclose(moved.base_from_flange, calibrated.base_from_flange @ turned)


@pytest.mark.parametrize("site", [site.name for site in SITES])
@pytest.mark.parametrize("covariate", ["time", "joint_2", "gravity", "approach_3"])
def test_a_curve_without_a_name_comes_back_from_its_file(site: str, covariate: str) -> None:
    model, views = cell()
    chosen = covariate_named(covariate)
    low, high = span(chosen.of(evaluate(model, views)))
    zero = present_curve(Curve(site_named(site), chosen, low, high), evaluate(model, views))
    assert zero.absent
    drawn = np.random.default_rng(2).normal(0, 1, len(zero.values))
    typical = np.array([p.typical if p.role == "amount" else 0.0 for p in zero.effect.parameters])
    curve = Present(zero.effect, zero.values + drawn * typical)
    written = {"law": curve.effect.law or "", **curve.as_mapping()}
    again = make_effect("empirical", written)
    reported = predict(model.with_effects([again]), views)
    assert np.array_equal(reported, predict(model.with_effects([curve]), views))
    assert np.abs(reported - predict(model, views)).max() > 1e-3


def test_a_periodic_curve_keeps_its_period() -> None:
    model, views = cell()
    curve = Curve(site_named("mounted_pose"), covariate_named("time"), 0.0, 1800.0, period=600.0)
    amounts = {"c0_rx_rad": 1e-3, "c1_y_m": 1e-3, "low": 0.0, "high": 1800.0, "period": 600.0}
    effect = empirical(curve, 2)
    direct = Present(effect, effect.values(amounts))
    again = make_effect("empirical", {"law": "mounted_pose/time", **amounts})
    later = replace(views, t_s=views.t_s + 600.0)
    first = predict(model.with_effects([again]), views)
    assert np.array_equal(first, predict(model.with_effects([direct]), views))
    assert np.allclose(first, predict(model.with_effects([again]), later), atol=1e-6)


def test_covariates_are_known_where_they_were_logged() -> None:
    model, views = cell()
    state = evaluate(model, views)
    for covariate in COVARIATES:
        value = covariate.of(state)
        assert len(value) == len(views), covariate.name
        logged = covariate.name != "focus_position"
        assert np.isfinite(value).all() == logged, covariate.name


def test_any_key_of_the_log_is_a_covariate_and_so_is_every_word_of_it() -> None:
    model, views = cell()
    half = np.arange(len(views)) % 2 == 0
    words = np.where(half, "near", "far")
    logged = replace(views, extra={"gain_db": np.where(half, 6.0, 0.0)}, labels={"lamp": words})
    names = [covariate.name for covariate in covariates_of(logged)]
    assert {"gain_db", "lamp=near", "lamp=far"} <= set(names)
    assert covariate_named("gain_db").unit == "dB"
    later = evaluate(model, logged.take(np.array([2, 3])))
    assert covariate_named("gain_db").of(later).tolist() == [6.0, 0.0]
    assert covariate_named("lamp=near").of(later).tolist() == [1.0, 0.0]
    assert np.isnan(covariate_named("moon").of(later)).all()
