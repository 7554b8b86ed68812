"""The benchmark's own cell says the same as the chain where nothing is concealed, and no more."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.discovery.faults import FAULTS
from benchmarks.discovery.oracle import consult
from benchmarks.discovery.physics import CATALOGUE, OUTSIDE, Physics
from benchmarks.discovery.recordings import Concealed, conceal, state
from benchmarks.discovery.run import views_of
from benchmarks.discovery.world import ARMS, CAMERAS, base_moment, links, sag_torques
from calib.chain.kinematics import arm
from calib.chain.model import CellModel, predict
from calib.chain.optics import optics_row
from calib.discovery.log_repair import repair_log


@pytest.mark.parametrize("name", ["clean 0", "clean 1", "clean 2", "clean 3"])
def test_a_clean_cell_shows_what_the_chain_predicts(name):
    case = conceal(name, background=False)
    cell, camera = case.cell, CAMERAS[case.cell.camera]
    optics = optics_row(
        alpha_px=cell.alpha,
        beta_px=cell.alpha,
        u0_px=cell.centre[0],
        v0_px=cell.centre[1],
        k1=camera["k1"],
        k2=camera["k2"],
    )
    views = views_of(case, np.arange(len(case.ahead)))
    poses = links(cell.arm, case.log["joints"])[-1]
    shown = predict(
        CellModel(optics, cell.mounted, cell.fixed), replace(views, base_from_flange=poses)
    )
    own = state(cell, case.log["joints"], case.log, ()).pixels()
    np.testing.assert_allclose(shown, own, atol=1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_arms_and_weights_are_those_of_the_maker(name):
    joints = np.random.default_rng(2).uniform(-2, 2, (5, 6))
    known = arm(name)
    np.testing.assert_allclose(links(name, joints)[-1], known.forward(joints), atol=1e-9)
    # a motor's torque holds the weight: the opposite of what the weight does
    scale = np.abs(known.gravity_torques(joints, 0.9)).max()
    torques = known.gravity_torques(joints, 0.9) + sag_torques(name, joints)
    assert np.abs(torques).max() < 0.05 * scale
    moment = known.base_moment(joints, 0.9)
    assert np.abs(moment - base_moment(name, joints)).max() < 0.05 * np.abs(moment).max()


@cache
def _nothing_concealed() -> Concealed:
    return conceal("moves", background=False)


@pytest.mark.parametrize("what", [*CATALOGUE, *OUTSIDE], ids=lambda what: what.key)
def test_physics_move_the_corners_by_what_can_be_seen(what: Physics):
    case = _nothing_concealed()
    plain = state(case.cell, case.log["joints"], case.log, ()).pixels()
    moved = state(case.cell, case.log["joints"], case.log, ((what, 1.0),)).pixels() - plain
    assert 0.1 < np.abs(moved).max() < 200.0


def test_the_oracle_knows_what_the_plain_model_does_not():
    slip = next(what for what in CATALOGUE if what.key == "board slips")
    found = consult(conceal("oracle", ((slip, 1.0),), background=False))
    assert found.detectable
    assert found.true_px < 0.5 * found.plain_px


LEFT_TO_THE_SEARCH = {
    *("base knocked", "focus ring bumped midway", "camera rebooted"),
    *("corners read wrongly for a while", "arm led by hand for a while"),
}
"""Something moved, or frames contradict the others: no reading of the log mends that."""


@pytest.mark.parametrize(
    "fault", [f for f in FAULTS if f.key not in LEFT_TO_THE_SEARCH], ids=lambda fault: fault.key
)
def test_every_fault_is_found_in_the_log(fault):
    case = conceal(f"fault 0: {fault.key}", (), fault.key)
    rows = np.arange(len(case.ahead))
    found = repair_log(views_of(case, rows[~case.ahead]), views_of(case, rows))
    names = [m.name for m in found.mixups] + [p.effect.name for p in found.known]
    assert names
    assert set(names) <= set(fault.names)


def test_pictures_of_two_scales_that_no_one_camera_shows_are_told_as_a_step():
    case = conceal("fault 12: binning midway", (), "binning midway")
    rows = np.arange(len(case.ahead))
    found = repair_log(views_of(case, rows[~case.ahead]), views_of(case, rows))
    assert [p.effect.name for p in found.known] == ["optics_step"]
