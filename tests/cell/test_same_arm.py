"""The arm that is connected is the one of the cell file, or nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import MODELS, arm
from cell.sequencer.same_arm import check_same_arm, flange_difference, model_differs
from drivers.arm import ArmState
from drivers.errors import SafetyError
from tests.cell.fakes import HOME, FakeArm
from tests.cell.test_sequencer import Bench


class OtherArm(FakeArm):
    """Its controller reports another model's flange, and says so where it has a name."""

    def __init__(self, now: Callable[[], float], name: str, says: str | None = None) -> None:
        super().__init__(now)
        self.name, self.says = name, says

    def state(self) -> ArmState:
        state = super().state()
        pose = RigidTransform.from_matrix(arm(self.name).forward(np.array(state.joints_rad)))
        raw = {} if self.says is None else {"model": self.says}
        return replace(state, base_from_flange=pose, raw=raw)


@pytest.mark.parametrize("name", ["ur3e", "ur5", "ur10e", "ur16e"])
def test_a_run_on_another_arm_ends_before_its_first_move(tmp_path: Path, name: str) -> None:
    bench = Bench(tmp_path)
    bench.arm = OtherArm(bench.clock.now, name)
    result = bench.run()
    assert result.finish.exit_status == 5
    assert "not the arm of the cell file" in result.reason
    assert "a ur5e's flange is at" in result.reason
    assert "move" not in bench.arm.calls


def test_both_names_are_reported(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.arm = OtherArm(bench.clock.now, "ur5e", says="UR10")
    result = bench.run()
    assert result.finish.exit_status == 5
    assert "robot.model ur5e, the controller calls its arm UR10" in result.reason
    assert "move" not in bench.arm.calls


@pytest.mark.parametrize(
    ("named", "says", "differ"),
    [
        ("ur5e", "UR5", False),
        ("ur7e", "UR7e", False),
        ("ur7e", "UR5", False),
        ("ur12e", "UR10", False),
        ("ur3", "UR5", True),
        ("ur10e", "UR16", True),
        ("ur5e", None, False),
        ("irb140", "UR5", False),
    ],
)
def test_sizes_are_compared_not_letters(named: str, says: str | None, differ: bool) -> None:
    assert bool(model_differs(named, says)) is differ


def test_a_factory_calibration_is_no_other_arm() -> None:
    """Offsets as large as a public UR10e's; the other models differ at the same joints."""
    robot = arm("ur10e")
    offset = np.zeros((6, 5))
    offset[:, 0] = [0, 2e-3, -3e-3, 1e-3, 1e-3, 0]
    offset[2, 2] = 1e-3
    reported = RigidTransform.from_matrix(robot.forward(HOME, offset))
    found = flange_difference(robot, HOME, reported)
    assert found.same
    assert 5e-4 < found.position_m < 5e-3
    same_build = {"ur10e", "ur12e"}
    for name in MODELS:
        if name.startswith("ur") and name not in same_build:
            assert not flange_difference(arm(name), HOME, reported).same, name


def test_without_joints_nothing_can_be_held_against_the_pose() -> None:
    state = replace(FakeArm().state(), joints_rad=None)
    check_same_arm(arm("ur10e"), state)
    with pytest.raises(SafetyError):
        check_same_arm(arm("ur10e"), FakeArm().state())
