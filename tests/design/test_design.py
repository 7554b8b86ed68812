"""What views will be worth, and which are chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.calibration.uncertainty import (
    focal_length_sigma_px,
    grid_m,
    grid_px,
    projection_sigma_px,
)
from calib.chain.effects import make_effect
from calib.design.choose import Criterion, choose_views
from calib.design.expected import expect
from calib.design.needs import Need, needs_of
from calib.solver.joint import fit_joint
from calib.solver.unknowns import unknowns_of
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

AT = np.linspace(-1.0, 1.0, 41)
LINE = np.stack([np.ones_like(AT), AT], axis=1)
CRITERION = Criterion(
    LINE[:, :, None] * LINE[:, None, :],
    [Need("slope", "1", np.array([[0.0, 1.0]])), Need("offset", "1", np.array([[1.0, 0.0]]))],
)
ALL = np.arange(len(AT))


def test_a_line_is_best_known_from_its_two_ends() -> None:
    picked = choose_views(CRITERION, [ALL] * 8)
    assert sorted(picked) == [0, 1, 2, 3, 37, 38, 39, 40]
    information = CRITERION.start + CRITERION.candidates[list(picked)].sum(axis=0)
    slope, offset = CRITERION.sigma(information)
    assert slope == pytest.approx(1 / np.sqrt((AT[list(picked)] ** 2).sum()), rel=1e-6)
    assert offset == pytest.approx(1 / np.sqrt(8), rel=1e-6)


def test_each_slot_takes_one_of_its_own_and_none_is_taken_twice() -> None:
    middle, ends = ALL[18:23], ALL[[0, 40]]
    picked = choose_views(CRITERION, [middle, middle, ends, ends, ends])
    assert len(picked) == len(set(picked)) == 4
    assert set(picked[:2]) <= set(middle)
    assert set(picked[2:]) == set(ends)
    assert choose_views(CRITERION, [ALL[:0], ends]) in ((0,), (40,))


def test_what_is_expected_is_what_a_fit_of_such_views_reports() -> None:
    lens = make_effect("focus_breathing", {"law": "thin_lens", "f_m": 0.012})
    true = plain_cell().with_effects([lens])
    views = record(true, log(24), seed=3)
    expected = expect(plain_cell(), [lens], views, NOISE)
    fit = fit_joint(true, views, unknowns_of(true), NOISE, fixed_noise=True)
    assert [u.name for u in expected.unknowns] == [u.name for u in fit.unknowns]
    reported, found = (np.sqrt(np.diag(e.covariance)) for e in (expected, fit))
    np.testing.assert_allclose(reported, found, rtol=0.1)


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_the_needs_are_what_the_report_will_show(mount: str) -> None:
    views = record(plain_cell(), log(24), seed=3)
    lens = make_effect("focus_breathing", {"law": "thin_lens"})
    expected = expect(plain_cell(), [lens], views, NOISE)
    shown = replace(views, mount=mount)
    sigma = {
        need.name: np.sqrt(np.sum(need.weight * expected.covariance))
        for need in needs_of(expected, shown, (0.35, 0.8))
    }
    grid = grid_px(shown, expected.model)
    pixels = projection_sigma_px(expected, shown, grid, grid_m((0.35, 0.8)))
    assert sigma["projection"] == pytest.approx(np.sqrt((pixels**2).mean()), rel=1e-6)
    alpha = focal_length_sigma_px(expected, shown, np.linspace(0.35, 0.8, 9))
    assert sigma["alpha"] == pytest.approx(np.sqrt((alpha**2).mean()), rel=1e-6)
    frame = "flange_from_mounted" if mount == "eye_in_hand" else "base_from_fixed"
    own = {
        u.name: s
        for u, s in zip(expected.unknowns, np.sqrt(np.diag(expected.covariance)), strict=True)
    }
    for name, axes in (("position", ("x", "y", "z")), ("rotation", ("rx", "ry", "rz"))):
        each = np.array([own[f"{frame}.{axis}"] for axis in axes])
        assert sigma[f"hand_eye_{name}"] == pytest.approx(np.sqrt((each**2).mean()), rel=1e-6)
