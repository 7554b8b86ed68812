"""A driver that a cell file may name exists everywhere: made, asked by doctor, and offered."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import pytest

from cell.devices.factory import arm_of, camera_of
from cell.storage.files.camera_file import CameraFile
from cell.storage.files.cell_file import CellFile, RobotFile, read_cell
from cell.verbs.doctor.described import described
from cell.verbs.doctor.reachable import reachable
from cell.verbs.init.answers import CameraDriver, RobotDriver
from sim.peers.loopback import own_address
from tests.cell.plans import CELL


def kinds(union: Any) -> dict[str, Any]:
    """Driver's name to its part of a cell file."""
    return {
        get_args(kind.model_fields["driver"].annotation)[0]: kind
        for kind in get_args(get_args(union)[0])
    }


ROBOTS, CAMERAS = kinds(RobotFile), kinds(CameraFile)
REAL_ROBOTS = [name for name in ROBOTS if name != "sim"]


@pytest.fixture
def cell(tmp_path: Path) -> CellFile:
    (tmp_path / "bench.yaml").write_text(CELL)
    return read_cell(tmp_path / "bench.yaml")


def with_robot(cell: CellFile, driver: str) -> CellFile:
    written = {"driver": driver, "model": "ur5e", "address": own_address()}
    return cell.model_copy(update={"robot": ROBOTS[driver].model_validate(written)})


@pytest.mark.parametrize("driver", REAL_ROBOTS)
def test_every_arm_has_a_driver(
    cell: CellFile, driver: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CELL_ROBOT_USER", "somebody")
    monkeypatch.setenv("CELL_ROBOT_PASSWORD", "secret")
    arm = arm_of(with_robot(cell, driver))
    for call in ("connect", "state", "start_move", "stop", "close"):
        assert callable(getattr(arm, call))
    assert arm.tried_on_hardware in (True, False)


@pytest.mark.parametrize("driver", REAL_ROBOTS)
def test_every_arm_is_asked_by_doctor_and_needs_its_bounds(cell: CellFile, driver: str) -> None:
    real = with_robot(cell, driver)
    assert "arm" not in {finding.name for finding in reachable(real)}
    assert "workspace and keep-out boxes" in {finding.name for finding in described(real)}


@pytest.mark.parametrize("driver", [name for name in CAMERAS if name != "sim"])
def test_every_camera_has_a_driver(cell: CellFile, driver: str, tmp_path: Path) -> None:
    written = {"driver": driver, "model": "any", "width": 640, "height": 480}
    fields = CAMERAS[driver].model_fields
    written |= {"address": own_address()} if "address" in fields else {}
    written |= {"producer": tmp_path / "maker.cti"} if "producer" in fields else {}
    camera = camera_of(cell.model_copy(update={"camera": CAMERAS[driver].model_validate(written)}))
    for call in ("connect", "close"):
        assert callable(getattr(camera, call))


def test_init_offers_every_driver() -> None:
    assert set(get_args(RobotDriver)) == set(ROBOTS)
    assert set(get_args(CameraDriver)) == set(CAMERAS)
