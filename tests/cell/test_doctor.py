from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from cell.doctor import examine
from cell.doctor.finding import Finding
from cell.factory import arm_of, camera_of
from cell.files.cell_file import CellFile, read_cell
from drivers.abb import ABBArm
from drivers.aravis import AravisCamera
from drivers.genicam_settings import FeatureNames
from drivers.robotiq import RobotiqCamera
from drivers.ur import URArm
from tests.cell.plans import CELL

SIM_ROBOT, SIM_CAMERA = "{driver: sim, model: ur5e}", "{driver: sim, model: bench-camera"


def cell_with(folder: Path, robot: str = SIM_ROBOT, camera: str = SIM_CAMERA) -> CellFile:
    (folder / "c.yaml").write_text(CELL.replace(SIM_ROBOT, robot).replace(SIM_CAMERA, camera))
    return read_cell(folder / "c.yaml")


def by_name(findings: list[Finding], part: str) -> Finding:
    return next(finding for finding in findings if part in finding.name)


def test_a_simulated_cell_is_ready(tmp_path: Path) -> None:
    findings = examine(cell_with(tmp_path))
    assert not [finding.line() for finding in findings if finding.blocks]
    assert by_name(findings, "numpy").found.startswith("2.")


def test_a_silent_robot_is_in_the_way(tmp_path: Path) -> None:
    findings = examine(cell_with(tmp_path, "{driver: ur, model: ur5e, address: 127.0.0.77}"))
    blocking = [finding for finding in findings if finding.blocks]
    assert [finding.name for finding in blocking] == [
        "UR dashboard 127.0.0.77:29999",
        "UR script 127.0.0.77:30003",
        "UR RTDE 127.0.0.77:30004",
    ]
    assert "check power" in blocking[0].line()


@pytest.fixture
def local_mode_robot() -> Iterator[str]:
    """A dashboard server of a robot in local mode."""
    address = "127.0.0.78"
    replies = {
        "is in remote control": "false",
        "safetystatus": "Safetystatus: NORMAL",
        "robotmode": "Robotmode: RUNNING",
    }

    def serve(listener: socket.socket) -> None:
        while True:
            try:
                link, _ = listener.accept()
            except OSError:
                return
            with contextlib.suppress(OSError), link, link.makefile("rw") as lines:
                lines.write("Connected: Universal Robots Dashboard Server\n")
                lines.flush()
                for line in lines:
                    lines.write(replies[line.strip()] + "\n")
                    lines.flush()

    with socket.create_server((address, 29999)) as listener:
        threading.Thread(target=serve, args=(listener,), daemon=True).start()
        yield address


def test_a_robot_in_local_mode_is_named(tmp_path: Path, local_mode_robot: str) -> None:
    robot = f"{{driver: ur, model: ur5e, address: {local_mode_robot}}}"
    findings = examine(cell_with(tmp_path, robot))
    remote = by_name(findings, "UR remote control")
    assert remote.blocks
    assert "switch the pendant from Local to Remote" in remote.line()
    assert by_name(findings, "UR safety").ready
    assert by_name(findings, "UR mode").ready


@pytest.fixture
def gige_camera() -> Iterator[str]:
    """Answers GVCP discovery as a camera does."""
    address = "127.0.0.79"
    record = bytearray(248)
    record[72:76], record[104:108] = b"Acme", b"Eye1"

    def serve(link: socket.socket) -> None:
        ask, sender = link.recvfrom(64)
        if ask[:4] == b"\x42\x01\x00\x02":
            link.sendto(b"\x00\x00\x00\x03\x00\xf8" + ask[6:8] + bytes(record), sender)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind((address, 3956))
        threading.Thread(target=serve, args=(link,), daemon=True).start()
        yield address


def test_a_gige_camera_tells_its_name(tmp_path: Path, gige_camera: str) -> None:
    camera = f"{{driver: gige, address: {gige_camera}, model: eye"
    findings = examine(cell_with(tmp_path, camera=camera))
    assert by_name(findings, "GigE camera").found == "Acme Eye1"
    assert by_name(findings, "packet size").ready


def test_a_missing_producer_is_in_the_way(tmp_path: Path) -> None:
    camera = "{driver: genicam, producer: /nowhere/coaxlink.cti, model: eye"
    finding = by_name(examine(cell_with(tmp_path, camera=camera)), "GenTL producer")
    assert finding.blocks
    assert "/nowhere/coaxlink.cti is not there" in finding.line()


def test_the_driver_follows_the_cell_file(tmp_path: Path) -> None:
    ur = cell_with(tmp_path, "{driver: ur, model: ur5e, address: 10.0.0.1}")
    abb = cell_with(
        tmp_path,
        "{driver: abb, model: irb140, address: 10.0.0.1}",
        "{driver: robotiq, address: 10.0.0.1, model: wrist",
    )
    assert isinstance(arm_of(ur), URArm)
    assert isinstance(arm_of(abb), ABBArm)
    assert isinstance(camera_of(abb), RobotiqCamera)


def test_what_the_file_says_of_a_camera_reaches_its_driver(tmp_path: Path) -> None:
    names = "{gain: DigitalGain, gain_is_factor: true, focus_position: Stepper}"
    gige = camera_of(
        cell_with(
            tmp_path,
            camera="{driver: gige, address: 10.0.0.1, packet_bytes: 1500, software_trigger: false,"
            f" feature_names: {names}",
        )
    )
    assert isinstance(gige, AravisCamera)
    assert gige.options.names.gain == ("DigitalGain",)
    assert gige.options.names.exposure == FeatureNames().exposure
    assert gige.options.focus_names.position == "Stepper"
    assert (gige.options.software_trigger, gige._packet_bytes) == (False, 1500)
    robotiq = camera_of(
        cell_with(tmp_path, camera="{driver: robotiq, address: 10.0.0.1, display_size: [640, 480]")
    )
    assert isinstance(robotiq, RobotiqCamera)
    assert robotiq._display_size == (640, 480)
