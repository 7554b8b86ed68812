"""A field over picture or board without a formula is carried, and predicts frames never fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.chain.effects import make_effect
from calib.chain.model import CellModel, evaluate, predict
from calib.discovery.laws.surface_field import demanded_field, put_in
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from calib.views import FloatArray, Views
from sim.render.surface import Surface, look
from tests.discovery.simulated_runs import BOARD, HEIGHT, NOISE, WIDTH, log, plain_cell, record

LOG = log(40)
FITTED, AHEAD = LOG.take(np.arange(40) < 30), LOG.take(np.arange(40) >= 30)


def bump(place: FloatArray, at: tuple[float, float], wide: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * ((place - at) ** 2).sum(axis=-1) / wide**2))


def dented(views: Views, noise: bool) -> Views:
    """A dent of 1.5 px in the window before the sensor, a twelfth of the picture wide."""
    made = (
        record(plain_cell(), views, 31)
        if noise
        else replace(views, corners_px=predict(plain_cell(), views))
    )
    near = bump(made.corners_px, (1250.0, 900.0), 170.0)
    return replace(made, corners_px=made.corners_px + 1.5 * near[..., None] * [0.6, -0.8])


def bumped(views: Views, noise: bool) -> Views:
    """A bump of 0.8 mm on the board, four squares wide."""
    height = 8e-4 * bump(BOARD.corners_m[:, :2], (0.08, 0.05), 0.035)
    offsets = np.concatenate([np.zeros((len(height), 2)), height[:, None]], axis=1)
    bent = replace(plain_cell(), corner_offsets_m=offsets)
    return record(bent, views, 32) if noise else replace(views, corners_px=predict(bent, views))


def missed(model: CellModel, true: FloatArray) -> float:
    return float(np.sqrt(np.mean((predict(model, AHEAD) - true) ** 2)))


@pytest.mark.parametrize(
    ("spoilt", "site"),
    [(dented, "image_field"), (bumped, "board_height")],
    ids=["image field", "board height"],
)
def test_a_field_is_carried_and_predicts_frames_that_were_not_fitted(spoilt, site):
    fitter = Fitter(spoilt(FITTED, True))
    search = Search(fitter.fit(plain_cell(), NOISE), fitter)
    reported = demanded_field(search)
    assert reported is not None
    assert reported[1].site == site
    before = search.best.fit
    put_in(search, reported[0])
    after = search.best.fit
    true, plain = spoilt(AHEAD, False).corners_px, predict(plain_cell(), AHEAD)
    sound = Fitter(record(plain_cell(), FITTED, 31)).fit(plain_cell(), NOISE)
    reached = [missed(before.model, true), missed(after.model, true), missed(sound.model, plain)]
    # what could be gained: the same cell fitted to a recording without the field
    assert reached[0] - reached[1] > 0.9 * (reached[0] - reached[2])
    assert after.noise.corner_px == pytest.approx(NOISE.corner_px, rel=0.1)
    assert demanded_field(search) is None
    (field,) = after.model.effects
    again = make_effect("empirical", {"law": str(field.effect.law), **field.as_mapping()})
    np.testing.assert_allclose(
        predict(after.model.with_effects([again]), AHEAD), predict(after.model, AHEAD), atol=1e-9
    )
    given = field.as_mapping()
    assert 0.0 < given["rms_sigma"] < 0.2 * given["rms"]


def test_where_no_field_is_none_is_carried():
    fitter = Fitter(record(plain_cell(), FITTED, 33))
    assert demanded_field(Search(fitter.fit(plain_cell(), NOISE), fitter)) is None


def test_pictures_are_rendered_through_the_field_that_corners_are_predicted_through():
    given = {"side_x": WIDTH, "side_y": HEIGHT, "wave_3_2_u": 2.0, "wave_3_2_v": -1.5}
    field = make_effect("empirical", {"law": "field:image_shift/image", **given})
    state = evaluate(plain_cell().with_effects([field]), LOG.take(np.arange(40) == 0))
    seen = state.pixels()[0]
    pose, optics = state.camera_from_board[0], state.optics[0]
    straight = evaluate(plain_cell(), state.views).pixels()[0]
    assert 0.5 < np.abs(seen - straight).max() < 3.0
    np.testing.assert_allclose(state.straightened(seen[None])[0], straight, atol=1e-9)
    surface = Surface(BOARD, state.points_m)
    nodes = look(surface, optics, pose, WIDTH, HEIGHT, state.straightened)
    # the grid's nodes next to a corner, interpolated, meet the board within that corner
    column, row = np.divmod(seen[12], 16)[0].astype(int) + 1
    part = (seen[12] % 16) / 16
    for node, corner in ((nodes.s, 12 % BOARD.cols), (nodes.t, 12 // BOARD.cols)):
        here = node[row : row + 2, column : column + 2]
        along = here[:, 0] * (1 - part[0]) + here[:, 1] * part[0]
        assert along[0] * (1 - part[1]) + along[1] * part[1] == pytest.approx(corner, abs=2e-3)
