"""A controller that is set otherwise than the cell file says moves nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cell.errors import EXIT_SAFETY
from cell.sequencer.states import Finish
from drivers.arm import ArmState
from tests.cell.fakes import FakeArm
from tests.cell.plans import CELL, PLAN
from tests.cell.test_sequencer import NO_BOARD, Bench

SET = CELL.replace(
    "model: ur5e}",
    "model: ur5e, payload_kg: 1.2, tcp: {p_m: [0.0, 0.0, 0.15], rpy_deg: [0, 0, 90]}}",
)
TCP = (0.0, 0.0, 0.15, 0.0, 0.0, np.pi / 2)
WIDE = ((-2 * np.pi, 2 * np.pi),) * 6


class SetArm(FakeArm):
    """Its controller reports how it is set."""

    raw: dict[str, Any]

    def state(self) -> ArmState:
        return replace(super().state(), raw=self.raw)


def bench_of(folder: Path, cell: str = SET, **reported: Any) -> Bench:
    bench = Bench(folder, PLAN + NO_BOARD, cell=cell)
    bench.arm = SetArm(bench.clock.now)
    bench.arm.raw = {
        "tcp_offset": reported.get("tcp", TCP),
        "payload": reported.get("payload", 1.2),
        "kinematics": {"joint_limits_rad": reported.get("limits", WIDE)},
    }
    return bench


@pytest.mark.parametrize(
    ("reported", "words"),
    [
        ({"tcp": (0, 0, 0.152, 0, 0, np.pi / 2)}, ["0.0 0.0 150.0 mm", "0.0 0.0 152.0 mm"]),
        ({"tcp": (0, 0, 0.15, 0, 0, np.pi / 2 + 0.02)}, ["90.0°", "91.1°"]),
        ({"tcp": (0.0,) * 6}, ["robot.tcp is 0.0 0.0 150.0 mm", "0.0 0.0 0.0 mm"]),
        ({"payload": 0.0}, ["robot.payload_kg is 1.2 kg", "payload 0 kg"]),
        ({"payload": 1.4}, ["1.2 kg", "1.4 kg"]),
        ({"limits": ((-1.0, 1.0), *WIDE[1:])}, ["joint 1", "-57.2958 to 57.2958°", "joint_1"]),
    ],
)
def test_a_difference_ends_the_run_before_the_first_move_with_both_values(
    tmp_path: Path, reported: dict[str, Any], words: list[str]
) -> None:
    bench = bench_of(tmp_path, **reported)
    result = bench.run()
    assert result.finish is Finish.SAFETY
    assert result.finish.exit_status == EXIT_SAFETY
    for word in words:
        assert word in result.reason
    assert "move" not in bench.arm.calls


@pytest.mark.parametrize(
    ("cell", "reported"),
    [
        (SET, {}),
        (SET, {"payload": 1.25, "tcp": (0, 0, 0.1505, 0, 0, np.pi / 2)}),
        (SET, {"payload": None, "tcp": None, "limits": None}),
        (CELL, {"payload": 3.0, "tcp": (0, 0, 0.3, 0, 0, 0)}),
    ],
    ids=["the same", "nearly", "not reported", "not stated"],
)
def test_what_agrees_or_is_not_known_is_no_obstacle(
    tmp_path: Path, cell: str, reported: dict[str, Any]
) -> None:
    result = bench_of(tmp_path, cell, **reported).run()
    assert (result.finish, result.frames) == (Finish.COMPLETED, 4), result.reason
