"""A dry run that was interrupted and gone on with is the one that was not, to the last bit."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from cell.devices.factory import simulated_devices
from cell.sequencer.session import record_plan
from cell.sequencer.states import Finish, Status
from cell.sequencer.stop import StopRequest
from cell.sequencer.watcher import Watcher
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.recording import read_recording
from tests.cell.plans import CELL, PLAN

TRUTH = """\
simulation:
  mounted: {p_m: [0.0, 0.0, 0.05], rpy_deg: [0, 0, 0]}
  fixed: {p_m: [-0.55, -0.2, 0.0], rpy_deg: [180, 0, 0]}
  optics: {alpha_px: 500, beta_px: 500, u0_px: 320, v0_px: 240}
  noise: {arm_position_m: 0.0003, arm_rotation_rad: 0.0003}
  effects:
  - {name: thermal_focal_drift, parameters: {relative: 0.01}}
  - {name: mount_slip, parameters: {at_frame: 1, x_m: 0.002}}
"""


class StopAfter(Watcher):
    """Asks to stop once so many frames are logged, as an operator would."""

    def __init__(self, stop: StopRequest, frames: int) -> None:
        self._stop, self._frames = stop, frames

    def status_changed(self, status: Status) -> None:
        if status.done >= self._frames:
            self._stop.ask("the test")


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    (tmp_path / "bench.yaml").write_text(CELL + TRUTH)
    (tmp_path / "plan.yaml").write_text(PLAN + "checks: {board: false}\n")
    return read_plan(tmp_path / "plan.yaml")


@pytest.mark.parametrize("after", [1, 2, 3])
def test_its_log_and_pictures_are_the_same(plan: Plan, tmp_path: Path, after: int) -> None:
    whole = record_plan(plan, tmp_path / "whole", simulated_devices(plan), simulated=True)
    stop = StopRequest()
    broken = record_plan(
        plan,
        tmp_path / "broken",
        simulated_devices(plan),
        simulated=True,
        stop=stop,
        watchers=[StopAfter(stop, after)],
    )
    assert broken.finish is Finish.STOPPED_BY_OPERATOR
    assert after <= broken.frames < whole.frames
    went_on = record_plan(
        plan, tmp_path / "broken", simulated_devices(plan), simulated=True, resume=True
    )
    assert (went_on.finish, went_on.frames) == (Finish.COMPLETED, whole.frames)
    first, second = (read_recording(tmp_path / name) for name in ("whole", "broken"))
    for one, other in zip(first.frames, second.frames, strict=True):
        assert one.as_line() == other.as_line()
    assert pictures(tmp_path / "whole") == pictures(tmp_path / "broken")


def pictures(folder: Path) -> dict[str, str]:
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted((folder / "images").glob("*.png"))
    }
