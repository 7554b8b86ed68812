"""Every effect of the catalogue: absent it changes nothing, present it does; it describes all."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from calib.chain.effect import LINKS, Effect, Present
from calib.chain.effects import catalogue, find_effect, make_effect
from calib.chain.model import evaluate, predict, start
from calib.chain.optics import COLUMN
from calib.views import Mount, Views
from tests.chain.cells import cell

LABELS = [effect.label for effect in catalogue()]
UNITS = {
    "1",
    "m",
    "rad",
    "s",
    "px",
    "px m^2",
    "frame",
    "m/rad^2",
    "px/g",
    "px/s",
    "px/dB",
    "dB",
    "m/K",
    "1/K",
    "degC",
    "rad/g",
    "rad/Nm",
}
SUFFIXES = {"m": "_m", "rad": "_rad", "s": "_s", "px m^2": "_px_m2", "m/rad^2": "_m_rad2"}
MUST_HAVE = {
    *("pose_time_lag", "joint_zero_offset", "link_geometry", "joint_compliance"),
    *("joint_backlash", "joint_periodic_error", "mount_flex", "thermal_mount_drift", "mount_slip"),
    *("board_warp", "board_scale", "board_shear", "board_slip", "focus_breathing"),
    *("focus_hysteresis", "thermal_focal_drift", "decentering", "higher_order_radial"),
    *("distance_dependent_distortion", "entrance_pupil_shift", "protective_window", "lens_sag"),
    *(
        "sensor_tilt",
        "rolling_shutter",
        "optics_step",
        "base_compliance",
        "base_drift",
        "exposure_bias",
        "mount_play",
        "thermal_image_drift",
    ),
}


def _effect(label: str) -> Effect:
    name, _, law = label.partition(":")
    return find_effect(name, law or None)


def _settings(effect: Effect, views: Views) -> Mapping[str, float]:
    return effect.candidates(views)[0]


def _present(effect: Effect, views: Views, amount: float) -> Present:
    typical = {p.name: p.typical * amount for p in effect.parameters if p.role == "amount"}
    return Present(effect, effect.values({**typical, **_settings(effect, views)}))


def test_every_effect_of_the_contract_is_there_under_its_name() -> None:
    assert {effect.name for effect in catalogue()} >= MUST_HAVE
    assert len(set(LABELS)) == len(LABELS)
    laws = {effect.law for effect in catalogue() if effect.name == "focus_breathing"}
    assert laws == {"inverse_square", "thin_lens", "free"}


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("label", LABELS)
def test_without_amount_nothing_changes_and_with_it_pixels_do(label: str, mount: Mount) -> None:
    effect = _effect(label)
    model, views = cell(mount)
    assert effect.missing(views) is None
    plain = predict(model, views)
    absent = _present(effect, views, 0.0)
    assert absent.absent
    assert np.array_equal(predict(model.with_effects([absent]), views), plain)
    state = start(model, views, evaluate(model, views).arm)
    state.camera_from_board = evaluate(model, views).camera_from_board
    before = state.optics.copy(), state.points_m.copy(), state.base_from_flange.copy()
    effect.act(absent.values, state)
    after = state.optics, state.points_m, state.base_from_flange
    assert all(
        np.allclose(b[..., : COLUMN["height_px"]], a[..., : COLUMN["height_px"]], atol=1e-15)
        for b, a in zip(before, after, strict=True)
    )
    present = _present(effect, views, 1.0)
    moved = np.abs(predict(model.with_effects([present]), views) - plain)
    assert np.isfinite(moved).all()
    assert moved.max() > 0.02


@pytest.mark.parametrize("label", LABELS)
def test_each_amount_that_can_be_fitted_matters_by_itself(label: str) -> None:
    effect = _effect(label)
    model, views = cell()
    plain = predict(model, views)
    for parameter in effect.parameters:
        if parameter.role != "amount" or not parameter.identifiable:
            continue
        values = effect.values({parameter.name: parameter.typical, **_settings(effect, views)})
        moved = predict(model.with_effects([Present(effect, values)]), views) - plain
        assert np.abs(moved).max() > 1e-3, parameter.name


@pytest.mark.parametrize("label", LABELS)
def test_an_effect_explains_itself(label: str) -> None:
    effect = _effect(label)
    assert effect.link in LINKS
    assert effect.physics.endswith(".")
    assert len(effect.physics.split()) >= 6
    for reported in (effect.equation, effect.source, effect.remedy):
        assert len(reported) > 12
    known = {e.name for e in catalogue()}
    assert set(effect.confounded_with) <= known - {effect.name}
    assert any(p.role == "amount" and p.identifiable for p in effect.parameters)
    for p in effect.parameters:
        assert p.unit in UNITS, p.name
        assert p.low <= p.typical <= p.high, p.name
        assert p.low < p.high, p.name
        suffix = SUFFIXES.get(p.unit)
        if suffix is not None:
            assert suffix in f"_{p.name}", p.name
        if p.role == "amount":
            assert p.low <= 0.0 <= p.high, p.name


@pytest.mark.parametrize("label", LABELS)
def test_what_an_effect_needs_is_missed_where_it_was_not_logged(label: str) -> None:
    effect = _effect(label)
    _, views = cell()
    for column in effect.needs:
        value = getattr(views, column)
        bare = replace(views, **{column: np.full_like(value, np.nan)})
        assert column in str(effect.missing(bare))
    if effect.varies:
        same = {c: np.full_like(views.logged(c), 0.01) for c in effect.varies if c != "gain_db"}
        steady = {key: np.full_like(column, 3.0) for key, column in views.extra.items()}
        assert "did not vary" in str(effect.missing(replace(views, **same, extra=steady)))
    if effect.moving_only:
        assert "moved" in str(effect.missing(replace(views, moving=False)))


def test_files_write_effects_by_name_law_and_numbers() -> None:
    present = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 18})
    assert present.as_mapping() == {"k_px_m2": 18.0}
    listed = make_effect("joint_zero_offset", {"offset_rad": [0, 0.001, 0, 0, 0, 0]})
    assert listed.as_mapping()["offset_rad_2"] == 0.001
    assert make_effect("thermal_focal_drift", {"relative": 1e-3}).as_mapping()["tau_s"] == 900.0


@pytest.mark.parametrize(
    ("name", "given", "reported"),
    [
        ("focus_breething", {}, "focus_breathing"),
        ("focus_breathing", {"k_px_m2": 1.0}, "inverse_square, thin_lens"),
        ("focus_breathing", {"law": "quadratic"}, "needs a law"),
        ("board_warp", {"bend_m": 1.0}, "bend_x_m"),
        ("board_warp", {"bend_x_m": "much"}, "is a number"),
        ("empirical", {"law": "nowhere/time", "c0_k1": 1.0}, "nowhere"),
    ],
)
def test_a_wrong_name_is_reported_with_those_that_exist(
    name: str, given: dict[str, float | str], reported: str
) -> None:
    with pytest.raises(KeyError) as caught:
        make_effect(name, given)
    assert reported in str(caught.value)
