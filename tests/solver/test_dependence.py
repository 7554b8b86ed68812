"""What is linearised, what a step moves, and evaluations that are resumed."""

import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.effect import Effect, Present
from calib.chain.effects import catalogue, make_effect
from calib.chain.model import Errors, StagedEvaluation, evaluate
from calib.chain.optics import COLUMN, OPTICS
from calib.solver.unknowns import dependence, moved, unknowns_of
from calib.views import Mount
from tests.chain.cells import cell

FREE = ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2")


def test_only_what_something_follows_is_active() -> None:
    model, views = cell(frames=3)
    found = dependence(model, views, unknowns_of(model), kinematics=None)
    assert {OPTICS[c] for c in found.active} == set(FREE)
    assert found.modes.shape == (0, 70, 3)
    warped = model.with_effects([make_effect("board_warp", {})])
    found = dependence(warped, views, unknowns_of(warped), kinematics=None)
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
def test_a_resumed_evaluation_ends_where_a_whole_one_does(mount: Mount) -> None:
    model, views = cell(mount, frames=10)
    model = model.with_effects(_everything())
    error = np.full((10, 6), 1e-4)
    staged = StagedEvaluation(model, views, errors=Errors(error))
    for unknown in unknowns_of(model, FREE):
        changed = moved(model, (unknown,), np.array([unknown.typical]))
        again = staged.from_stage(changed, staged.entry(unknown.place))
        whole = evaluate(changed, views, errors=Errors(error))
        assert np.array_equal(again.optics, whole.optics), unknown.name
        assert np.array_equal(again.camera_from_board, whole.camera_from_board), unknown.name
        assert np.array_equal(again.points_m, whole.points_m), unknown.name
    untouched = evaluate(model, views, errors=Errors(error))
    assert np.array_equal(staged.state.optics, untouched.optics)
    assert np.array_equal(staged.state.points_m, untouched.points_m)
