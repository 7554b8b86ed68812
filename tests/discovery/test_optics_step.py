"""A camera changed midway: found by the pictures where large, by the search where small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.calibration.baseline import fit_baseline
from calib.calibration.frames import usable_frames
from calib.chain.effects import make_effect
from calib.chain.model import predict
from calib.discovery.diagnose import diagnose
from calib.discovery.log_consistency.picture_step import find_picture_step
from calib.discovery.prove import prediction_rms_px
from calib.views import Views
from tests.discovery.simulated_runs import log, plain_cell, record

LOG = log(32)
CLEAN = record(plain_cell(), LOG, seed=21)


def changed(at: int, scale: float, shift_px: tuple[float, float]) -> Views:
    """The clean run with its later pictures scaled about the corner of the first pixel."""
    corners = CLEAN.corners_px.copy()
    corners[at:] = (corners[at:] + 0.5) * scale - 0.5 + np.array(shift_px)
    return replace(CLEAN, corners_px=corners)


@pytest.mark.parametrize(
    ("at", "scale", "shift_px"),
    [(8, 0.5, (0.0, 0.0)), (16, 0.5, (0.0, 0.0)), (25, 1.0, (-300.0, -200.0)), (16, 2.0, (0, 0))],
)
def test_binning_and_region_are_found_from_the_pictures_alone(at, scale, shift_px):
    views = changed(at, scale, shift_px)
    found = find_picture_step(views, fit_baseline(views, usable_frames(views)))
    assert found is not None
    given = found.step.as_mapping()
    assert given["at_frame"] == views.frame[at - 1] + 1
    assert given["relative"] == pytest.approx(scale - 1.0, abs=5e-3)


@pytest.mark.parametrize("effect", [None, ("board_warp", {"bend_x_m": 5e-4, "twist_m": 3e-4})])
def test_one_camera_is_one(effect):
    effects = [] if effect is None else [make_effect(*effect)]
    views = record(plain_cell().with_effects(effects), LOG, seed=23)
    assert find_picture_step(views, fit_baseline(views, usable_frames(views))) is None


def test_a_binning_midway_is_named_with_its_frame_and_predicted():
    views = changed(10, 0.5, (0.0, 0.0)).take(np.arange(20))
    found = diagnose(views)
    assert found.verdict == "explained"
    (effect,) = found.effects
    assert effect.name == "optics_step"
    assert effect.parameters["at_frame"].value == views.frame[9] + 1
    assert abs(effect.parameters["relative"].value + 0.5) < 1e-3
    ahead = log(12, seed=91)
    true = 0.5 * (predict(plain_cell(), ahead) + 0.5) - 0.5
    late = replace(ahead, frame=100 + ahead.frame, corners_px=true)
    assert prediction_rms_px(found.twin.model, late) < 0.3


def test_a_bumped_focus_ring_is_named_and_measured():
    bump = make_effect(
        "optics_step",
        {"relative": -2e-3, "u_px": -2.0, "v_px": 3.0, "at_frame": float(LOG.frame[17])},
    )
    found = diagnose(record(plain_cell().with_effects([bump]), LOG, seed=24))
    assert [e.name for e in found.effects] == ["optics_step"]
    reported = found.effects[0].parameters
    assert reported["at_frame"].value == LOG.frame[17]
    for name, value in bump.as_mapping().items():
        assert abs(reported[name].value - value) <= 3.5 * reported[name].sigma
