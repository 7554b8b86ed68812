"""Values and derivatives of the whole chain, effect by effect, against the tests' own oracle.

A model's pixels follow its lens, its two transforms, each effect's numbers and each flange's error:
all of them are held to automatic differentiation of other formulas (`tests/chain/oracle`).
"""

from collections.abc import Sequence
from dataclasses import replace

import autograd
import numpy as np
import pytest

from calib.chain.covariates import COVARIATES, covariate_named
from calib.chain.effect import Effect, Present
from calib.chain.effects import catalogue
from calib.chain.empirical import SITES, Curve, present_curve, span
from calib.chain.model import CellModel, Errors, evaluate, predict
from calib.chain.optics import COLUMN, NEVER_FREE, OPTICS
from calib.chain.projection import project_with_jacobians
from calib.solver.unknowns import Dependence, Unknown, dependence, unknowns_of
from calib.views import FloatArray, Mount, Views
from tests.chain.cells import cell
from tests.chain.oracle.curves import COVARIATES as KNOWN_COVARIATES
from tests.chain.oracle.curves import SITES as KNOWN_SITES
from tests.chain.oracle.run import Run, oracle_of, zero

FRAMES = (0, 7)
"""The first and one behind a slip, both away from where a sign turns."""
CORNERS = (0, 33)
MOUNTS: tuple[Mount, ...] = ("eye_in_hand", "eye_to_hand")
SHARE = 3e-5
"""Rounding in differences of pixels is up to 5e-6 of a derivative; a term left out is far more."""
LENS = ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2")
WHOLE_LENS = tuple(c for c in OPTICS if c not in NEVER_FREE and not c.startswith("sweep"))


def _pixels_by(found: Dependence) -> tuple[FloatArray, FloatArray]:
    """(N, M, 2, p) and (N, M, 2, 6): pixels by the free numbers and by the flange's error."""
    state = found.state
    pose = state.camera_from_board
    _, by_pose, by_optics = project_with_jacobians(state.optics, pose, state.points_m)
    by_point = np.einsum("nmck,nkj->nmcj", by_pose[..., :3], pose[:, :3, :3])
    by_mode = np.einsum("nmcj,bmj->nmcb", by_point, found.modes)
    columns = np.concatenate([by_optics[..., list(found.active)], by_pose, by_mode], axis=-1)
    by_free = np.einsum("nmcq,nqp->nmcp", columns, found.local)
    q = found.own.shape[1]
    return by_free, np.einsum("nmcq,nqj->nmcj", columns[..., :q], found.own)


def _all_numbers(model: CellModel, lens: tuple[str, ...]) -> tuple[Unknown, ...]:
    """Whatever can be differentiated by: amounts that no fit can find, too."""
    own = unknowns_of(model, lens)
    known = {u.place for u in own}
    more = [
        Unknown(p.name, p.unit, p.typical, ("effect", at, k))
        for at, present in enumerate(model.effects)
        for k, p in enumerate(present.effect.parameters)
        if p.role != "setting" and ("effect", at, k) not in known
    ]
    return (*own, *more)


UNMOVED = ("rad_per_Nm_1", "rad_per_Nm_6")
"""A vertical axis bears no weight, and the last joint's weights lie on its axis."""


def _check(
    model: CellModel,
    views: Views,
    lens: tuple[str, ...] = LENS,
    frames: Sequence[int] = FRAMES,
) -> None:
    numbers = _all_numbers(model, lens)
    error = np.random.default_rng(5).normal(0.0, 2e-4, (len(views), 6))
    run = Run(model, views, numbers, error)
    found = dependence(model, views, numbers, kinematics=None, errors=Errors(error))
    by_free, by_flange = _pixels_by(found)
    pixels = predict(model, views, errors=Errors(error))[:, CORNERS]
    ours = np.concatenate([by_free, by_flange], axis=-1)[:, CORNERS]
    wanted = []
    for i in frames:
        reported = run.pixels(zero(numbers), i, CORNERS)
        assert np.abs(reported - pixels[i]).max() < 1e-6, f"frame {i}: another pixel"
        wanted.append(autograd.jacobian(run.pixels)(zero(numbers), i, CORNERS))
    expected = np.array(wanted)
    scale = np.abs(expected).max(axis=(0, 1, 2))
    names = [*(u.name for u in numbers), *(f"flange error {k}" for k in range(6))]
    still = [name for name, size in zip(names, scale, strict=True) if size < 1e-9]
    assert set(still) <= set(UNMOVED), f"nothing follows {still}"
    scale = np.maximum(scale, 1e-9)
    off = np.abs(ours[list(frames)] - expected).max(axis=(0, 1, 2)) / scale
    wrong = {name: float(e) for name, e in zip(names, off, strict=True) if e > SHARE}
    assert not wrong, f"derivatives off by these shares of themselves: {wrong}"


def _sized(effect: Effect, views: Views) -> Present:
    """The effect with each of its amounts at another size, some of them negative."""
    amounts = [p for p in effect.parameters if p.role == "amount"]
    sizes = {p.name: p.typical * (1.0 - 0.3 * k) for k, p in enumerate(amounts)}
    return Present(effect, effect.values({**sizes, **effect.candidates(views)[0]}))


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("effect", catalogue(), ids=lambda effect: effect.label)
def test_every_effect_does_what_its_oracle_does(effect: Effect, mount: Mount) -> None:
    model, views = cell(mount, frames=10)
    _check(model.with_effects([_sized(effect, views)]), views)


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("left_out", ["exposure_bias", "rolling_shutter"])
def test_all_effects_at_once_do_what_their_oracles_do(left_out: str, mount: Mount) -> None:
    """Not both: the chain takes the row of a mark that grew for the row that it was exposed in.

    That is 0.002 px at these sizes, a pixel's growth times a row's time.
    """
    model, views = cell(mount, frames=10)
    lens = np.random.default_rng(6).normal(0.0, 0.01, len(WHOLE_LENS) - 5)
    optics = model.optics.copy()
    optics[[COLUMN[c] for c in WHOLE_LENS[5:]]] += lens
    effects = [_sized(effect, views) for effect in catalogue() if effect.name != left_out]
    _check(replace(model, optics=optics).with_effects(effects), views, WHOLE_LENS)


def test_a_lens_whose_focus_was_logged_does_not_follow_the_board() -> None:
    model, views = cell(frames=10)
    views = replace(views, focus_distance_m=np.linspace(0.35, 0.7, len(views)))
    effects = [_sized(effect, views) for effect in catalogue() if effect.link == "lens"]
    _check(model.with_effects(effects), views)


def test_a_number_at_its_bound_has_its_whole_derivative() -> None:
    model, views = cell(frames=10)
    tilt = next(effect for effect in catalogue() if effect.name == "sensor_tilt")
    at_bounds = Present(tilt, np.array([p.high for p in tilt.parameters]))
    _check(model.with_effects([at_bounds]), views)


def _curve(site: str, covariate: str, views: Views, model: CellModel) -> Present:
    """A curve with every coefficient at some size of its own."""
    where = next(s for s in SITES if s.name == site)
    chosen = covariate_named(covariate)
    low, high = span(chosen.of(evaluate(model, views)))
    zero_curve = present_curve(Curve(where, chosen, low - 0.1, high + 0.1), evaluate(model, views))
    typical = np.array([p.typical * (p.role == "amount") for p in zero_curve.effect.parameters])
    sizes = np.random.default_rng(7).uniform(0.5, 1.5, len(typical))
    return replace(zero_curve, values=zero_curve.values + sizes * typical)


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("site", [site.name for site in SITES])
def test_every_site_follows_a_curve_as_its_oracle_does(site: str, mount: Mount) -> None:
    assert site in KNOWN_SITES, f"say in tests/chain/oracle/curves.py what {site} shifts"
    model, views = cell(mount, frames=10)
    _check(model.with_effects([_curve(site, "tilt", views, model)]), views, frames=FRAMES[1:])


@pytest.mark.parametrize("covariate", [covariate.name for covariate in COVARIATES])
def test_every_covariate_is_what_its_oracle_says(covariate: str) -> None:
    assert covariate in KNOWN_COVARIATES, f"say in tests/chain/oracle/curves.py what {covariate} is"
    model, views = cell(frames=10)
    views = replace(views, focus_position=np.linspace(100.0, 900.0, len(views)))
    model = model.with_effects([_curve("mounted_pose", covariate, views, model)])
    _check(model, views, frames=FRAMES[1:])


def test_an_effect_without_an_oracle_is_asked_for_one() -> None:
    new = replace(catalogue()[0], name="gear_wear", law=None)
    with pytest.raises(AssertionError, match="gear_wear has no oracle: say in tests/chain/oracle"):
        oracle_of(Present(new, new.values({})))
