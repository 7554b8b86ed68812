"""A dry run through the real drivers, wire and all, beside the same run in one process."""

from __future__ import annotations

import multiprocessing
import re
import socket
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import cell.devices.peers
from calib.detection import Detection, detect
from cell.cli.app import app
from cell.devices.factory import peer_devices, simulated_devices
from cell.errors import InputError
from cell.sequencer.journal import read_journal
from cell.sequencer.session import record_plan
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.recording import Recording, read_recording
from drivers.abb import ABBArm
from drivers.aravis import AravisCamera
from drivers.errors import DeviceRefused
from drivers.robotiq import RobotiqCamera
from drivers.ur import URArm
from sim.peers.loopback import own_address

CONFIGS = Path(__file__).parents[2] / "configs"
SMALL = {"width: 4096": "width: 1024", "height: 3072": "height: 768", "pixel_size_um: 5.625": ""}
SMALL |= {"alpha_px: 4755.8": "alpha_px: 1188.95", "beta_px: 4789.1": "beta_px: 1197.28"}
SMALL |= {"u0_px: 2052.3": "u0_px: 512.7", "v0_px: 1548.5": "v0_px: 386.75", "57.1": "0.2"}


def short_plan(folder: Path, name: str, views: int, camera: str, **changes: str) -> Plan:
    """The first views of a plan of `configs/`, with another camera's name, made quick."""
    text = (CONFIGS / f"{name}.cell.yaml").read_text()
    text = re.sub(r"(  model: )\w+", rf"\g<1>{camera}", text, count=1)
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    (folder / f"{name}.cell.yaml").write_text(text)
    lines = (CONFIGS / f"{name}.plan.yaml").read_text().replace("m_s: 0.1", "m_s: 0.25")
    head, *listed = re.split(r"(?m)^(?=- )", lines)
    path = folder / "plan.yaml"
    path.write_text("".join([head, *listed[:views]]))
    return read_plan(path)


def corners(recording: Recording) -> np.ndarray:
    """(N, M, 2) pixels."""
    found = [detect(recording.image(frame), recording.board) for frame in recording.frames]
    assert all(isinstance(one, Detection) for one in found)
    return np.array([one.corners_px for one in found if isinstance(one, Detection)])


@pytest.mark.parametrize(
    ("name", "views", "camera", "drivers", "changes"),
    [
        ("ur3-robotiq", 8, "gige_camera", (URArm, AravisCamera), {}),
        ("irb140-eosens", 2, "robotiq_wrist", (ABBArm, RobotiqCamera), SMALL),
    ],
    ids=["ur-gige", "abb-robotiq"],
)
def test_a_run_through_the_wires_records_what_a_run_in_one_process_does(
    tmp_path: Path,
    name: str,
    views: int,
    camera: str,
    drivers: tuple[type, type],
    changes: dict[str, str],
) -> None:
    plan = short_plan(tmp_path, name, views, camera, **changes)
    recordings = []
    for context in (peer_devices(plan), nullcontext(simulated_devices(plan))):
        folder = tmp_path / str(len(recordings))
        with context as devices:
            if not recordings:
                assert isinstance(devices.arm, drivers[0])
                assert isinstance(devices.camera, drivers[1])
            result = record_plan(plan, folder, devices, simulated=True)
        assert (result.reason, result.frames) == ("", views)
        assert "retry" not in [event["event"] for event in read_journal(folder)]
        recordings.append(read_recording(folder))
    wired, direct = recordings
    for ours, theirs in zip(wired.frames, direct.frames, strict=True):
        np.testing.assert_allclose(ours.joints_rad, theirs.joints_rad, atol=2e-6)
        assert ours.focus_position == theirs.focus_position
    difference = corners(wired) - corners(direct)
    assert np.sqrt((difference**2).mean()) < 0.06
    assert not multiprocessing.active_children()


def test_the_peers_end_with_the_run_that_fails(tmp_path: Path) -> None:
    plan = short_plan(tmp_path, "ur3-robotiq", 1, "robotiq_wrist")

    def fail() -> None:
        with peer_devices(plan) as devices:
            devices.arm.connect()
            raise ZeroDivisionError(len(multiprocessing.active_children()))

    with pytest.raises(ZeroDivisionError, match="1"):
        fail()
    assert not multiprocessing.active_children()


def test_addresses_that_are_taken_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = short_plan(tmp_path, "ur3-robotiq", 1, "robotiq_wrist")
    address = own_address()
    monkeypatch.setattr(cell.devices.peers, "own_address", lambda: address)
    monkeypatch.setattr(cell.devices.peers, "_compile", lambda cell: None)
    with (
        socket.create_server((address, 30001)),
        pytest.raises(InputError, match="cannot listen"),
        peer_devices(plan),
    ):
        pass


def test_a_missing_aravis_is_reported_before_anything_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = short_plan(tmp_path, "ur3-robotiq", 1, "gige_camera")
    monkeypatch.setitem(sys.modules, "gi", None)
    with pytest.raises(DeviceRefused, match="apt-get install python3-gi"), peer_devices(plan):
        pass
    assert not multiprocessing.active_children()


def test_peers_are_for_dry_runs_only() -> None:
    result = CliRunner().invoke(app, ["run", str(CONFIGS / "ur3-robotiq.plan.yaml"), "--peers"])
    assert isinstance(result.exception, InputError)
    assert "--dry-run --peers" in str(result.exception)
