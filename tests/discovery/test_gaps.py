"""Where no frame supports a free curve it follows its neighbours: no prediction suffers by it."""

from __future__ import annotations

import numpy as np
import pytest

from calib.chain.effect import Present
from calib.chain.effects import make_effect
from calib.chain.model import CellModel, evaluate, predict
from calib.chain.projection import project
from calib.discovery.start import Fitter
from calib.views import FloatArray, Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(60)
DISTANCE_M = evaluate(plain_cell(), LOG).distance_m
TRUE = make_effect("focus_breathing", {"law": "thin_lens", "f_m": 0.003})
GAPS_M = ((0.0, 0.44), (0.52, 0.64), (0.74, 1.0))


def free(near_m: float, far_m: float) -> Present:
    return make_effect("focus_breathing", {"law": "free", "near_m": near_m, "far_m": far_m})


def missed_px(model: CellModel, true: CellModel, views: Views) -> float:
    miss: FloatArray = predict(model, views) - predict(true, views)
    return float(np.sqrt((miss**2).sum(axis=2).mean()))


@pytest.mark.parametrize("present", [(), (TRUE,)], ids=["nothing there", "breathing"])
def test_frames_in_a_gap_are_predicted_no_worse_than_by_the_plain_cell(present):
    true = plain_cell().with_effects(present)
    views = record(true, LOG, 51)
    for near_m, far_m in GAPS_M:
        gap = (near_m < DISTANCE_M) & (far_m > DISTANCE_M)
        shown = Fitter(views.take(np.flatnonzero(~gap)[:26]))
        plain = shown.fit(plain_cell(), NOISE)
        fitted = shown.with_effects(plain, [free(0.3, 0.75)])
        unseen = LOG.take(gap)
        before = missed_px(plain.model, true, unseen)
        assert missed_px(fitted.model, true, unseen) < 1.15 * before + 0.02


def test_beyond_its_nodes_the_curve_goes_on_straight():
    bent = free(0.5, 0.75)
    bent.values[:5] = [0.01, 0.03, 0.01, 0.02, 0.0]
    model = plain_cell().with_effects([bent])
    state = evaluate(model, LOG)
    assert project(state.optics, state.camera_from_board, state.points_m).shape[0] == len(LOG)
    growth = state.optics[:, 0] / plain_cell().optics[0]
    beyond = DISTANCE_M < 0.5
    inverse = 1.0 / DISTANCE_M[beyond]
    line = np.polynomial.Polynomial.fit(inverse, growth[beyond], 1)
    assert beyond.sum() > 5
    np.testing.assert_allclose(line(inverse), growth[beyond], atol=1e-9)
