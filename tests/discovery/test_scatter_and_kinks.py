"""Chance and kinks look like physics to a smooth curve; they are reported for what they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain.effects import make_effect
from calib.chain.kinematics import arm
from calib.chain.model import Errors, evaluate
from calib.chain.projection import project
from calib.discovery.diagnose import diagnose
from calib.discovery.residual_structure import ResidualStructure
from calib.discovery.scatter import scattered
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from calib.solver.joint import fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import unknowns_of
from calib.views import FloatArray, Views
from tests.discovery.simulated_runs import NOISE, log, plain_cell, record

LOG = log(30)
SCATTER = 8e-4
QUIET = Noise(corner_px=0.04, flange_m=5e-6, flange_rad=1.5e-5)


def with_focus_by_chance(seed: int) -> tuple[Views, FloatArray]:
    """A recording with an autofocus that never ends in the same place; and its (N,) errors."""
    rng = np.random.default_rng(seed)
    error = SCATTER * rng.standard_normal(len(LOG))
    flange = np.repeat([NOISE.flange_m, NOISE.flange_rad], 3) * rng.standard_normal((len(LOG), 6))
    state = evaluate(plain_cell(), LOG, errors=Errors(flange, error))
    corners = project(state.optics, state.camera_from_board, state.points_m)
    corners += NOISE.corner_px * rng.standard_normal(corners.shape)
    return replace(LOG, corners_px=corners), error


def test_the_joint_fit_finds_every_frame_s_focal_error_and_leaves_the_arm_its_own():
    views, true = with_focus_by_chance(71)
    model = plain_cell()
    fit = fit_joint(model, views, unknowns_of(model), replace(NOISE, focal=1e-4))
    assert 0.85 * true.std() < fit.noise.focal < 1.15 * true.std()
    assert fit.noise.flange_m < 1.8 * NOISE.flange_m
    assert 0.6 * NOISE.flange_rad < fit.noise.flange_rad < 1.5 * NOISE.flange_rad
    assert np.corrcoef(fit.own_error[:, 6], true)[0, 1] > 0.97


def test_a_focal_length_that_scatters_by_chance_is_reported_as_that_and_nothing_is_named_for_it():
    found = diagnose(with_focus_by_chance(72)[0])
    assert found.verdict == "unexplained"
    assert found.effects == ()
    assert found.unexplained is not None
    assert (found.unexplained.site, found.unexplained.covariate) == ("focal_length", "chance")
    assert found.unexplained.p_value < 1e-8


def kinked() -> Views:
    """The third joint goes wrong by 3 mrad a radian from 1.2 rad on."""
    kinematics = arm("ur5e")
    bent = LOG.joints_rad.copy()
    bent[:, 2] += 3e-3 * np.maximum(0.0, bent[:, 2] - 1.2)
    moved = replace(LOG, base_from_flange=kinematics.forward(bent))
    made = record(plain_cell(), moved, seed=73, noise=QUIET)
    return replace(made, base_from_flange=LOG.base_from_flange[made.frame])


def test_a_kink_is_carried_by_one_law_and_nothing_is_named_for_what_a_smooth_one_leaves():
    found = diagnose(kinked())
    assert found.verdict == "unexplained"
    assert found.effects == ()
    assert found.unexplained is not None
    assert (found.unexplained.site, found.unexplained.covariate) == ("joint_3", "joint_3")
    (law,) = found.twin.model.effects
    assert law.effect.law == "hinge:joint_3.joint_3/joint_3"
    assert law.as_mapping()["at"] == pytest.approx(1.2, abs=0.05)
    assert found.proof.rms_px_before > 3.0
    assert found.proof.rms_px_after < 1.2 * found.proof.noise_px


def searched(views: Views) -> Search:
    fitter = Fitter(views)
    return Search(fitter.fit(plain_cell(), NOISE), fitter)


def test_one_frame_that_is_far_off_is_no_scatter():
    error = np.zeros(len(LOG))
    error[4] = 6e-3
    state = evaluate(plain_cell(), LOG, errors=Errors(focal=error))
    corners = project(state.optics, state.camera_from_board, state.points_m)
    corners += NOISE.corner_px * np.random.default_rng(74).standard_normal(corners.shape)
    search = searched(replace(LOG, corners_px=corners))
    assert scattered(ResidualStructure(search, ())) is None
    wide = searched(with_focus_by_chance(75)[0])
    found = scattered(ResidualStructure(wide, ()))
    assert found is not None
    assert 0.5 * SCATTER < found.relative < 1.6 * SCATTER


@pytest.mark.parametrize("side_m", [0.0, 1e3])
def test_from_which_side_the_first_frame_was_focused_is_found(side_m):
    play = make_effect(
        "focus_hysteresis", {"relative": 2e-3, "first_frame": 0.0, "first_came_from_m": side_m}
    )
    search = searched(record(plain_cell().with_effects([play]), LOG, seed=76))
    best, _ = search.ranked(search.best.fit)[0]
    assert best.effect.name == "focus_hysteresis"
    assert best.present.as_mapping()["first_came_from_m"] == side_m
