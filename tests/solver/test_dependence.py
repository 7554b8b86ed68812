"""How pixels follow every free number of a cell, against automatic differentiation."""

import autograd
import autograd.numpy as anp
import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.effect import Effect, Present
from calib.chain.effects import catalogue, make_effect
from calib.chain.kinematics import arm
from calib.chain.model import CellModel, Journey, predict, walk
from calib.chain.optics import COLUMN, OPTICS
from calib.chain.projection import project_with_jacobians
from calib.solver.unknowns import Dependence, dependence, moved, unknowns_of
from calib.views import FloatArray, Mount, Views
from tests.chain import independent
from tests.chain.cells import ARM, cell

FREE = ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2")
JOINTS = (2, 3, 4, 5)
LOOKED_AT = [0, 9, 33, 69]
"""Corners: two ends of a row, the middle, the far end."""


def _rich_cell(mount: Mount) -> tuple[CellModel, Views]:
    model, views = cell(mount, frames=2)
    effects = [
        make_effect("joint_zero_offset", {f"offset_rad_{j}": 1e-3 * j for j in JOINTS}),
        make_effect(
            "mount_flex",
            {
                "rad_per_g": 2e-3,
                "rad_per_g_lever_x": 1e-3,
                "rad_per_g_lever_y": -5e-4,
                "rad_per_g_turn": 7e-4,
            },
        ),
        make_effect("board_warp", {"bend_x_m": 1e-3, "bend_y_m": -5e-4, "twist_m": 7e-4}),
        make_effect("focus_breathing", {"law": "thin_lens", "f_m": 0.016}),
        make_effect("decentering", {"p1": 1e-3, "p2": -2e-3}),
        make_effect("lens_sag", {"px_per_g": 2.0}),
        make_effect("sensor_tilt", {"tilt_x_rad": 0.01, "tilt_y_rad": -0.02}),
    ]
    return model.with_effects(effects), views


def _pixels(x: object, flange_error: object, model: CellModel, views: Views, i: int) -> object:
    """(4, 2) of frame `i` as a function of the free numbers' increments, by other formulas."""
    x = anp.array(x)
    optics = dict(zip(OPTICS, model.optics, strict=True))
    for k, name in enumerate(FREE):
        optics[name] = optics[name] + x[k]
    at = len(FREE)
    mounted = anp.dot(model.flange_from_mounted, independent.rigid(x[at : at + 6]))
    fixed = anp.dot(model.base_from_fixed, independent.rigid(x[at + 6 : at + 12]))
    values = anp.concatenate([p.values[_free(p)] for p in model.effects]) + x[at + 12 :]
    offset, flex, warp, thin, centre, sag, tilt = _split(values, [4, 4, 3, 1, 2, 1, 2])
    joints, dh = views.joints_rad[i], arm(ARM).dh
    moved_joints = anp.concatenate([joints[:1], joints[1:5] + offset, joints[5:]])
    back = np.linalg.inv(independent.flange(joints, dh))
    flange = anp.dot(views.base_from_flange[i], anp.dot(back, independent.flange(moved_joints, dh)))
    flange = anp.dot(flange, independent.rigid(flange_error))
    down = anp.dot(flange[:3, :3].T, anp.array([0.0, 0.0, -1.0]))
    lever = independent.cross_matrix([flex[1], flex[2], flex[0]])
    bend = anp.dot(lever, down) + flex[3] * down
    mounted = anp.dot(independent.rigid(anp.concatenate([anp.zeros(3), bend])), mounted)
    rides = anp.dot(flange, mounted)
    camera, board = (rides, fixed) if views.mount == "eye_in_hand" else (fixed, rides)
    pose = anp.dot(anp.linalg.inv(camera), board)
    points = _warped(views, warp)
    distance = anp.dot(pose, anp.concatenate([anp.mean(points, axis=0), anp.array([1.0])]))[2]
    growth = distance / (distance - thin[0])
    gravity = anp.dot(camera[:3, :3].T, anp.array([0.0, 0.0, -1.0]))
    optics |= {
        "alpha_px": optics["alpha_px"] * growth,
        "beta_px": optics["beta_px"] * growth,
        "p1": optics["p1"] + centre[0],
        "p2": optics["p2"] + centre[1],
        "u0_px": optics["u0_px"] + sag[0] * gravity[0],
        "v0_px": optics["v0_px"] + sag[0] * gravity[1],
        "tilt_x_rad": optics["tilt_x_rad"] + tilt[0],
        "tilt_y_rad": optics["tilt_y_rad"] + tilt[1],
    }
    seen = anp.dot(points[LOOKED_AT], pose[:3, :3].T) + pose[:3, 3]
    return independent.pixel(optics, seen.T).T


def _free(present: object) -> list[int]:
    parameters = present.effect.parameters  # type: ignore[attr-defined]
    return [k for k, p in enumerate(parameters) if p.identifiable and p.role != "setting"]


def _split(values: object, counts: list[int]) -> list[object]:
    ends = np.cumsum(counts)
    return [values[e - c : e] for e, c in zip(ends, counts, strict=True)]  # type: ignore[index]


def _warped(views: Views, warp: object) -> object:
    board = views.board
    flat = board.corners_m
    x = flat[:, 0] / ((board.cols - 1) * board.square_m) * 2 - 1
    y = flat[:, 1] / ((board.rows - 1) * board.square_m) * 2 - 1
    height = warp[0] * (x**2 - 1) + warp[1] * (y**2 - 1) + warp[2] * x * y  # type: ignore[index]
    return anp.stack([flat[:, 0], flat[:, 1], height], axis=1)


def _pixels_by(found: Dependence) -> tuple[FloatArray, FloatArray]:
    """(N, M, 2, p) and (N, M, 2, 6): pixels by the free numbers and by the flange's error."""
    state = found.state
    pose = state.camera_from_board
    _, by_pose, by_optics = project_with_jacobians(state.optics, pose, state.points_m)
    by_point = np.einsum("nmck,nkj->nmcj", by_pose[..., :3], pose[:, :3, :3])
    by_mode = np.einsum("nmcj,bmj->nmcb", by_point, found.modes)
    columns = np.concatenate([by_optics[..., list(found.active)], by_pose, by_mode], axis=-1)
    by_free = np.einsum("nmcq,nqp->nmcp", columns, found.local)
    return by_free, np.einsum("nmck,nkj->nmcj", by_pose, found.flange)


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_the_whole_chain_s_derivatives_are_right(mount: Mount) -> None:
    model, views = _rich_cell(mount)
    unknowns = unknowns_of(model, FREE)
    found = dependence(
        model, views, unknowns, kinematics=None, flange_error=np.zeros((len(views), 6))
    )
    by_free, by_flange = _pixels_by(found)
    zero, still = np.zeros(len(unknowns)), np.zeros(6)
    pixels = predict(model, views)[:, LOOKED_AT]
    by_free, by_flange = by_free[:, LOOKED_AT], by_flange[:, LOOKED_AT]
    for i in range(len(views)):
        assert np.allclose(_pixels(zero, still, model, views, i), pixels[i], atol=1e-8)
        expected = autograd.jacobian(_pixels, 0)(zero, still, model, views, i)
        scale = np.abs(expected).max(axis=(0, 1))
        assert scale.min() > 0.0
        assert np.abs((by_free[i] - expected) / scale).max() < 1e-6
        # the lens's and the mount's answer to a flange error is left out: its share is small
        expected = autograd.jacobian(_pixels, 1)(zero, still, model, views, i)
        error = np.abs(by_flange[i] - expected) / np.abs(expected).max(axis=(0, 1))
        assert error.max() < 0.05


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_a_plain_cell_s_flange_derivative_is_exact(mount: Mount) -> None:
    model, views = cell(mount, frames=3)
    found = dependence(
        model, views, unknowns_of(model), kinematics=None, flange_error=np.zeros((3, 6))
    )
    _, by_flange = _pixels_by(found)
    for k in range(6):
        error = np.zeros((3, 6))
        error[:, k] = 1e-6
        ahead = predict(model, views, flange_error=error)
        behind = predict(model, views, flange_error=-error)
        assert np.allclose(by_flange[..., k], (ahead - behind) / 2e-6, rtol=1e-5, atol=1e-3)


def test_only_what_something_follows_is_active() -> None:
    model, views = cell(frames=3)
    found = dependence(model, views, unknowns_of(model), kinematics=None, flange_error=None)
    assert {OPTICS[c] for c in found.active} == set(FREE)
    assert found.modes.shape == (0, 70, 3)
    warped = model.with_effects([make_effect("board_warp", {})])
    found = dependence(warped, views, unknowns_of(warped), kinematics=None, flange_error=None)
    assert found.modes.shape == (3, 70, 3)


def test_a_step_moves_what_it_names_and_stays_within_bounds() -> None:
    model, _ = cell()
    model = model.with_effects([make_effect("decentering", {})])
    unknowns = unknowns_of(model)
    names = [u.name for u in unknowns]
    step = np.zeros(len(unknowns))
    step[names.index("u0_px")] = 3.0
    step[names.index("base_from_fixed.y")] = 0.01
    step[names.index("decentering.p1")] = 1.0
    after = moved(model, unknowns, step)
    assert after.optics[COLUMN["u0_px"]] == model.optics[COLUMN["u0_px"]] + 3.0
    increment = rigid.to_vector(rigid.inverse(model.base_from_fixed) @ after.base_from_fixed)
    assert np.allclose(increment, [0, 0.01, 0, 0, 0, 0])
    assert np.array_equal(after.flange_from_mounted, model.flange_from_mounted)
    assert after.effects[0].as_mapping()["p1"] == 0.05


def _everything() -> list[Present]:
    """Every effect at its usual size, and two curves, one of which looks ahead."""
    _, views = cell(frames=10)
    effects = [Present(e, e.values({**_typical(e), **e.candidates(views)[0]})) for e in catalogue()]
    curve = {"low": 0.3, "high": 0.8, "c0_joint_2": 2e-4, "c4_joint_2": 1e-4}
    flex = {"c0_x_m": 1e-4, "c2_rz_rad": 2e-4}
    return [
        *effects,
        make_effect("empirical", {"law": "joint_2/distance", **curve}),
        make_effect("empirical", {"law": "mounted_pose/gravity", **flex}),
    ]


def _typical(effect: Effect) -> dict[str, float]:
    return {p.name: 0.3 * p.typical for p in effect.parameters if p.role == "amount"}


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_a_walk_taken_up_again_ends_where_a_whole_one_does(mount: Mount) -> None:
    model, views = cell(mount, frames=10)
    model = model.with_effects(_everything())
    error = np.full((10, 6), 1e-4)
    journey = Journey(model, views, flange_error=error)
    for unknown in unknowns_of(model, FREE):
        changed = moved(model, (unknown,), np.array([unknown.typical]))
        again = journey.again(changed, journey.entry(unknown.place))
        whole = walk(changed, views, flange_error=error)
        assert np.array_equal(again.optics, whole.optics), unknown.name
        assert np.array_equal(again.camera_from_board, whole.camera_from_board), unknown.name
        assert np.array_equal(again.points_m, whole.points_m), unknown.name
    untouched = walk(model, views, flange_error=error)
    assert np.array_equal(journey.state.optics, untouched.optics)
    assert np.array_equal(journey.state.points_m, untouched.points_m)
