"""What different frames agree on stands out; what a few frames err by does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.effects import make_effect
from calib.chain.rigid import from_vector
from calib.discovery.locate import Cell, locate
from calib.discovery.spread import stands_out
from calib.discovery.start import Fitter
from calib.solver.joint import JointFit
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(32)


def located(views: Views) -> tuple[JointFit, list[Cell]]:
    fit = Fitter(views).fit(plain_cell(), NOISE)
    return fit, [c for c in locate(fit, views, periods=False) if not c.is_field]


def test_a_focal_length_that_follows_the_distance_stands_out():
    breathing = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 5.0})
    views = record(plain_cell().with_effects([breathing]), LOG, 41)
    fit, cells = located(views)
    assert cells[0].p_value < 1e-9
    assert stands_out(fit, views, cells[0], 1e-6)


def test_a_few_frames_far_off_are_significant_and_do_not_stand_out():
    views = record(plain_cell(), LOG, 42)
    rng = np.random.default_rng(43)
    off = np.zeros((len(views), 6))
    far = np.argsort(-views.joints_rad[:, 2])[:4]
    off[far] = rng.normal(0.0, 1.0, (4, 6)) * np.array([4e-4] * 3 + [1.2e-3] * 3)
    views = replace(views, base_from_flange=views.base_from_flange @ from_vector(off))
    fit, cells = located(views)
    assert cells[0].p_value < 1e-4
    assert not any(stands_out(fit, views, cell) for cell in cells[:20])


def test_a_lens_that_differs_from_picture_to_picture_follows_nothing():
    """Corners of one picture that err alike: more than their number says, along anything."""
    views = record(plain_cell(), LOG, 44)
    away = views.corners_px - np.array([1024.0, 768.0])
    square = (away**2).sum(axis=2, keepdims=True) / 1024.0**2
    amount = np.random.default_rng(45).normal(0.0, 2e-3, (len(views), 1, 1))
    views = replace(views, corners_px=views.corners_px + amount * away * square)
    fit, cells = located(views)
    of_lens = [c for c in cells if c.site == "radial_distortion" and c.p_value < 1e-4]
    assert len(of_lens) > 1
    assert not any(stands_out(fit, views, cell, 1e-5) for cell in of_lens)
