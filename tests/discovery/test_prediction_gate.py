"""Nothing stays that predicts frames without a say in the fit worse than the plain cell does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain.effects import make_effect
from calib.chain.laws.arm_field import coordinates, present_field
from calib.discovery.prediction_gate import Missed, drop_what_predicts_worse, missed_by
from calib.discovery.residual_structure import ResidualStructure
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from calib.views import Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(32)
EVERY_LENGTH = make_effect("link_geometry", {})
BREATHING = make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": 5.0})


def gated(views: Views, held: Views, *effects):
    fitter = Fitter(views)
    plain = fitter.fit(plain_cell(), NOISE)
    search = Search(plain, fitter)
    search.force(effects)
    structure, dropped = drop_what_predicts_worse(ResidualStructure(search, ()), plain, held)
    fit = structure.search.best.fit
    after = missed_by(fit, fit.weight, views, held)
    before = missed_by(plain, fit.weight, views, held)
    return structure, dropped, before, after


def test_numbers_that_only_fit_are_dropped_and_it_is_reported():
    views = record(plain_cell(), LOG, 31)
    structure, dropped, before, after = gated(views.take(np.arange(9)), views, EVERY_LENGTH)
    assert structure.search.best.fit.model.effects == ()
    assert structure.cells == ()
    assert len(dropped) == 1
    assert str(dropped[0]).startswith("link_geometry fitted these frames but was dropped")
    assert dropped[0].with_px > dropped[0].without_px
    # the plain cell again, but for where the search for its noise came to rest
    assert after.left_out.sum() == pytest.approx(before.left_out.sum(), rel=1e-3)
    assert after.held_out == pytest.approx(before.held_out, rel=1e-2)


def test_of_two_the_one_that_predicts_worse_goes_and_the_true_one_stays():
    views = record(plain_cell().with_effects([BREATHING]), LOG, 32)
    few, rest = views.take(np.arange(11)), views.take(np.arange(11, len(views)))
    slip = make_effect("board_slip", {"at_frame": 9})
    structure, dropped, before, after = gated(few, rest, BREATHING, slip)
    assert "focus_breathing" in [p.effect.name for p in structure.search.best.fit.model.effects]
    assert "focus_breathing" not in [d.present.effect.name for d in dropped]
    assert after.rms_px < 0.5 * before.rms_px


def test_unseen_frames_have_weight_beyond_chance():
    plain = Missed(np.ones(8), np.ones(4))
    assert not replace(plain, left_out=np.full(8, 0.5)).worse_than(plain)
    assert replace(plain, left_out=np.full(8, 1.1)).worse_than(plain)
    much_worse = Missed(np.full(8, 0.5), np.array([2.0, 2.2, 1.9, 2.1]))
    assert much_worse.worse_than(plain)
    chance = Missed(np.full(8, 0.5), np.array([1.9, 0.4, 1.6, 0.3]))
    assert not chance.worse_than(plain)


def test_a_field_of_the_arm_is_judged_by_frames_that_it_does_not_stand_on():
    views = record(plain_cell(), LOG, 33)
    nodes = coordinates(views, "joints")
    weights = np.random.default_rng(3).normal(0.0, 5e-4, (len(nodes), 6))
    field = present_field("joints", nodes, weights, 0.05, 0.95)
    fit = Fitter(views).fit(plain_cell().with_effects([field]), NOISE)
    missed = missed_by(fit, fit.weight, views, views)
    # so short a length says nothing of other frames, however far it moves those it stands on
    assert np.sqrt(missed.held_out.mean()) > 2.0
    assert np.sqrt(missed.left_out.mean()) < 0.6
