"""A guess as a prior: what one view leaves open, what a few close, and whether sigma is honest."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from calib.calibration.roughly_known import (
    FRAMES_FOR_NOISE,
    GuessSigma,
    fit_roughly_known,
    guess_from_one_view,
    with_sigma,
)
from calib.chain import rigid
from calib.chain.model import CellModel, predict
from calib.solver.joint import JointFit
from calib.views import Mount, Views
from tests.paper.scene import ALPHA0, FLANGE_FROM_MOUNTED, mixed_scene

DOUBT = GuessSigma(mounted_m=0.025, mounted_rad=float(np.radians(5.0)), alpha_share=0.1)


@cache
def scene_views(mount: Mount = "eye_in_hand") -> Views:
    return mixed_scene(4, 12, noise_px=0.05, mount=mount, seed=3).views


def fitted(frames: int, mount: Mount = "eye_in_hand", seed: int = 0) -> JointFit:
    step = np.random.default_rng(seed).uniform(-1, 1, 6) * np.repeat([0.03, 0.1], 3)
    views = scene_views(mount).take(np.arange(frames))
    wrong = FLANGE_FROM_MOUNTED @ rigid.from_vector(step)
    guess = guess_from_one_view(views, wrong, 1.05 * ALPHA0, refocuses=False)
    return fit_roughly_known(views, guess, DOUBT)


def test_one_view_leaves_the_mount_as_open_as_it_was_stated() -> None:
    fit = fitted(1)
    assert fit.sigma("flange_from_mounted.x") == pytest.approx(DOUBT.mounted_m, rel=0.05)
    assert fit.sigma("flange_from_mounted.rx") == pytest.approx(DOUBT.mounted_rad, rel=0.05)
    assert np.nanmax(np.abs(fit.residual_px)) < 1.0


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_a_few_views_find_what_was_wrong_by_centimetres(mount: Mount) -> None:
    fit = fitted(FRAMES_FOR_NOISE + 4, mount)
    off = rigid.to_vector(rigid.inverse(FLANGE_FROM_MOUNTED) @ fit.model.flange_from_mounted)
    assert np.abs(off[:3]).max() < 1e-3
    assert np.abs(off[3:]).max() < np.radians(0.1)


def test_what_comes_next_lies_within_the_sigmas_of_what_came_before() -> None:
    coming = scene_views().take(np.array([5, 9]))

    def pixels(model: CellModel) -> np.ndarray:  # type: ignore[type-arg]
        return predict(model, coming)

    standard = []
    for seed in range(6):
        value, sigma = with_sigma(fitted(2, seed=seed), pixels)
        standard.append((value - coming.corners_px) / np.hypot(sigma, 0.5))
    assert np.abs(standard).max() < 3.0
    assert np.sqrt(np.mean(np.square(standard))) > 0.1


def test_a_quantitys_sigma_is_that_of_its_number() -> None:
    fit = fitted(4)
    value, sigma = with_sigma(fit, lambda model: model.optics[:1])
    assert value == pytest.approx(fit.model.optics[0])
    assert sigma == pytest.approx(fit.sigma("alpha_px"), rel=1e-6)
