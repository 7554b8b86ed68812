"""A simulated arm errs as a real one was measured to: smoothly, through what was measured."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from benchmarks.discovery.semi_real import MeasuredArm, beside, errs_as_measured
from benchmarks.discovery.world import HOME, inverse, make_cell

JOINTS = [f"q{k}_deg" for k in range(1, 7)]
ERRORS = [f"kinematic_d{a}_mm" for a in "xyz"] + [f"kinematic_r{a}_deg" for a in "xyz"]


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Sixty measured poses whose error is a wave over the joints."""
    joints = np.random.default_rng(3).uniform(-60.0, 60.0, (60, 6))
    wave = np.sin(np.radians(joints) @ np.random.default_rng(4).normal(0.0, 1.0, (6, 6)))
    path = tmp_path_factory.mktemp("tracker") / "pose_errors.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow([*JOINTS, *ERRORS])
        table.writerows(np.concatenate([joints, 0.3 * wave], axis=1).tolist())
    return MeasuredArm(path)


def test_the_drawn_error_goes_through_the_measured_ones_and_is_alike_nearby(arm):
    seen = arm.joints[:5]
    near = np.concatenate([seen, seen + 0.02])
    drawn = arm.drawn(near, np.random.default_rng(1))
    np.testing.assert_allclose(drawn[:5], arm.errors[:5], atol=0.02 * arm.unit.max())
    assert np.abs(drawn[5:] - drawn[:5]).max() < 1.5 * arm.unit.max()
    away = arm.drawn(seen + 20.0, np.random.default_rng(1))
    assert 0.3 < (away / arm.unit).std() < 2.0


def test_a_cell_with_that_arm_errs_by_it_and_its_seed_fixes_it(arm):
    rng = np.random.default_rng(5)
    cell = make_cell(rng, background=False)
    joints = HOME + rng.normal(0.0, 0.3, (12, 6))
    states = [cell.state(joints, {"joints": joints}) for _ in range(3)]
    physics = errs_as_measured(arm, 7)
    for state in states[1:]:
        physics.act(state, 1.0)
    plain, one, two = (state.mounted for state in states)
    np.testing.assert_array_equal(one, two)
    moved_m = (inverse(plain) @ one)[:, :3, 3]
    assert 0.2 < np.sqrt((moved_m**2).mean()) / arm.unit[:3].mean() < 3.0
    assert beside(0) == ()
    assert beside(1)[0].key == "focus inverse square"
