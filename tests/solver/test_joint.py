"""The joint fit: truth, noise levels, outliers, print noise, both mounts."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.chain.optics import COLUMN
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import unknowns_of
from calib.views import FloatArray, Mount, Views
from tests.paper.scene import (
    ALPHA0,
    BASE_FROM_FIXED,
    BETA0,
    BOARD,
    FLANGE_FROM_MOUNTED,
    HEIGHT,
    U0,
    V0,
    Scene,
    mixed_scene,
)

NOISE_PX, ROBOT_M, ROBOT_RAD = 0.05, 5e-5, np.radians(0.005)
THIN_F_M = 0.018
GUESS = Noise(0.2, 3e-4, 3e-4)


@cache
def _scene(mount: Mount = "eye_in_hand", seed: int = 1) -> Scene:
    return mixed_scene(
        20,
        30,
        noise_px=NOISE_PX,
        thin_f_m=THIN_F_M,
        k1=-0.05,
        robot_mm=1e3 * ROBOT_M,
        robot_deg=float(np.degrees(ROBOT_RAD)),
        mount=mount,
        seed=seed,
    )


def _start(*, breathing: bool = True) -> CellModel:
    """Off by a per cent, some millimetres and some tenths of a degree."""
    from calib.chain.optics import optics_row

    optics = optics_row(
        alpha_px=ALPHA0 * 1.01, beta_px=BETA0 * 1.01, u0_px=U0 + 9, v0_px=V0 - 9, height_px=HEIGHT
    )
    nudge = rigid.from_vector(np.array([2e-3, -3e-3, 2e-3, 3e-3, -4e-3, 2e-3]))
    lens = [make_effect("focus_breathing", {"law": "thin_lens"})] if breathing else []
    return CellModel(optics, FLANGE_FROM_MOUNTED @ nudge, BASE_FROM_FIXED @ nudge, tuple(lens))


def _fit(views: Views, noise: Noise = GUESS, **keywords: object) -> JointFit:
    model = _start()
    return fit_joint(model, views, unknowns_of(model), noise, **keywords)  # type: ignore[arg-type]


@cache
def _clean(mount: Mount = "eye_in_hand") -> JointFit:
    return _fit(_scene(mount).views)


def _truth(fit: JointFit) -> FloatArray:
    """(p,) how far every free number is from the truth, in the fit's own increments."""
    model = fit.model
    true = {"alpha_px": ALPHA0, "beta_px": BETA0, "u0_px": U0, "v0_px": V0, "k1": -0.05, "k2": 0.0}
    lens = [model.optics[COLUMN[name]] - value for name, value in true.items()]
    mounted = rigid.to_vector(rigid.inverse(FLANGE_FROM_MOUNTED) @ model.flange_from_mounted)
    fixed = rigid.to_vector(rigid.inverse(BASE_FROM_FIXED) @ model.base_from_fixed)
    return np.concatenate([lens, mounted, fixed, [model.effects[0].values[0] - THIN_F_M]])


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_everything_comes_back_within_its_uncertainty(mount: Mount) -> None:
    fit = _clean(mount)
    assert fit.converged
    error = _truth(fit)
    square = float(error @ np.linalg.solve(fit.covariance, error))
    # chi-squared of 19: above 43.8 once in a thousand
    assert square < 43.8
    assert np.sqrt(np.diag(fit.covariance)[0]) < 0.3


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_the_noise_levels_are_found(mount: Mount) -> None:
    noise = _clean(mount).noise
    # 50 frames, 3 axes: 5.8 % of a standard deviation
    assert noise.corner_px == pytest.approx(NOISE_PX, rel=0.04)
    assert noise.flange_m == pytest.approx(ROBOT_M, rel=0.25)
    assert noise.flange_rad == pytest.approx(ROBOT_RAD, rel=0.25)


def test_the_flange_errors_are_found_frame_by_frame() -> None:
    scene, fit = _scene(), _clean()
    true = rigid.to_vector(_logged_to_true(scene))
    left = (fit.flange_error - true)[:, :3]
    assert np.sqrt(np.mean(left**2)) < 0.6 * np.sqrt(np.mean(true[:, :3] ** 2))


def _logged_to_true(scene: Scene) -> FloatArray:
    """(N, 4, 4) error of each flange in its own frame; the logged pose carries its inverse."""
    board_from_camera = rigid.inverse(scene.camera_from_board)
    true = BASE_FROM_FIXED @ board_from_camera @ rigid.inverse(FLANGE_FROM_MOUNTED)
    return np.asarray(rigid.inverse(scene.views.base_from_flange) @ true)


def test_wrong_corners_weigh_nothing_and_harm_nothing() -> None:
    scene = _scene()
    rng = np.random.default_rng(5)
    corners = scene.views.corners_px.copy()
    wrong = rng.random(corners.shape[:2]) < 0.05
    angle = rng.uniform(0, 2 * np.pi, int(wrong.sum()))
    corners[wrong] += 5.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    fit = _fit(replace(scene.views, corners_px=corners))
    clean = _clean()
    assert fit.weight[wrong].max() < 0.01
    assert (fit.weight[~wrong] == 1.0).mean() > 0.97
    change = np.abs(_truth(fit) - _truth(clean)) / np.sqrt(np.diag(clean.covariance))
    assert change.max() < 1.0
    assert fit.noise.corner_px == pytest.approx(NOISE_PX, rel=0.1)


def test_print_noise_is_distinguished_from_corner_noise() -> None:
    scene = _scene()
    rng = np.random.default_rng(11)
    offset = np.zeros((BOARD.corner_count, 3))
    offset[:, :2] = rng.normal(0, 3e-5, (BOARD.corner_count, 2))
    from calib.chain.projection import project

    moved = project(scene.optics, scene.camera_from_board, BOARD.corners_m + offset)
    straight = project(scene.optics, scene.camera_from_board, BOARD.corners_m)
    views = replace(scene.views, corners_px=scene.views.corners_px + moved - straight)
    fit = _fit(views, replace(GUESS, print_m=1e-5))
    assert fit.noise.print_m == pytest.approx(3e-5, rel=0.25)
    assert fit.noise.corner_px == pytest.approx(NOISE_PX, rel=0.05)
    assert fit.model.corner_offsets_m is not None
    found = fit.model.corner_offsets_m[:, :2]
    assert np.corrcoef(found.ravel(), offset[:, :2].ravel())[0, 1] > 0.95
    held = _fit(views)
    assert held.minus_two_log > fit.minus_two_log + 100.0


def test_a_flat_print_needs_no_freedom() -> None:
    fit = _fit(_scene().views, replace(GUESS, print_m=1e-5))
    assert fit.noise.print_m < 3e-6
    assert _clean().minus_two_log < fit.minus_two_log + 4.0


def test_a_law_that_is_there_is_far_more_likely_than_none() -> None:
    views = _scene().views
    still = _start(breathing=False)
    constant = fit_joint(still, views, unknowns_of(still), GUESS)
    assert constant.minus_two_log > _clean().minus_two_log + 1000.0


def test_fixed_noise_stays_as_given() -> None:
    given = Noise(0.07, 4e-5, 1e-4)
    assert _fit(_scene().views, given, fixed_noise=True).noise == given


def test_a_frame_without_pose_is_refused() -> None:
    views = _scene().views
    flange = views.base_from_flange.copy()
    flange[3] = np.nan
    with pytest.raises(ValueError, match="base_from_flange"):
        _fit(replace(views, base_from_flange=flange))
