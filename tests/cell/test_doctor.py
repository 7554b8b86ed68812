from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from calib.chain.kinematics import arm as kinematics_of
from cell.devices.factory import arm_of, camera_of
from cell.storage.files.cell_file import CellFile, read_cell
from cell.verbs.doctor import examine
from cell.verbs.doctor.finding import Finding
from drivers import aravis_network
from drivers.abb import ABBArm
from drivers.abb.transport import certificate_of
from drivers.aravis import AravisCamera
from drivers.genicam_settings import FeatureNames
from drivers.robotiq import RobotiqCamera
from drivers.ur import URArm
from sim.arm import SimArm
from sim.clock import WallClock
from sim.peers.abb import ABBController
from sim.peers.callable_camera import CallableCamera
from sim.peers.gige import GigEPeer
from sim.peers.loopback import own_address
from sim.peers.robotiq import RobotiqPeer
from sim.peers.ur import URController
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


@pytest.mark.parametrize(
    "robot",
    [
        "{driver: sim, model: kr10}",
        "{driver: ur, model: kr10, address: 127.0.0.77}",
        "{driver: abb, model: kr10, address: 127.0.0.77, factory_password: true}",
        "{driver: ur, address: 127.0.0.77}",
    ],
)
def test_an_arm_whose_kinematics_nobody_knows_is_in_the_way(tmp_path: Path, robot: str) -> None:
    finding = by_name(examine(cell_with(tmp_path, robot)), "kinematics")
    assert finding.blocks
    assert "robot.model" in finding.found
    assert "irb140" in finding.mend


@pytest.mark.parametrize("key", ["workspace", "keep_out"])
def test_a_real_arm_that_nothing_bounds_is_in_the_way(tmp_path: Path, key: str) -> None:
    real = "{driver: ur, model: ur5e, address: 127.0.0.77}"
    file = YAML().load(CELL.replace(SIM_ROBOT, real))
    del file[key]
    with (tmp_path / "c.yaml").open("w") as out:
        YAML().dump(file, out)
    finding = by_name(examine(read_cell(tmp_path / "c.yaml")), "workspace and keep-out")
    assert finding.blocks
    assert f"`{key}`" in finding.found
    whole = by_name(examine(cell_with(tmp_path, real)), "workspace and keep-out")
    assert whole.line() == "ok   workspace and keep-out boxes: workspace, 1 keep-out boxes"


def test_a_silent_robot_is_in_the_way(tmp_path: Path) -> None:
    findings = examine(cell_with(tmp_path, "{driver: ur, model: ur5e, address: 127.0.0.77}"))
    blocking = [finding for finding in findings if finding.blocks]
    assert [finding.name for finding in blocking] == [
        "UR controller",
        "UR script 127.0.0.77:30003",
        "UR RTDE 127.0.0.77:30004",
    ]
    assert "check power" in blocking[0].line()


def standing(model: str) -> SimArm:
    """An arm whose kinematics are compiled now, not while somebody waits for an answer."""
    arm = SimArm(kinematics_of(model), WallClock(), np.zeros(6))
    arm.connect()
    arm.state()
    return arm


@pytest.fixture
def ur() -> Iterator[URController]:
    arm = standing("ur5e")
    kinematics = kinematics_of("ur5e")
    with URController(arm, own_address(), kinematics=kinematics) as controller:
        yield controller


def ur_cell(folder: Path, controller: URController) -> CellFile:
    return cell_with(folder, f"{{driver: ur, model: ur5e, address: {controller.address}}}")


def test_a_ready_robot_is_reported_as_ready(tmp_path: Path, ur: URController) -> None:
    ur.tcp_offset = (0.0, 0.0, 0.15, 0.0, 0.0, 0.0)
    findings = examine(ur_cell(tmp_path, ur))
    assert not [finding.line() for finding in findings if finding.blocks]
    assert "0.0 0.0 150.0 mm from the flange" in by_name(findings, "UR tool").found
    assert "taken out of every pose" in by_name(findings, "UR tool").found
    assert "s from this computer's" in by_name(findings, "UR clock").found
    assert "weigh camera and bracket" in by_name(findings, "payload").line()


def test_polyscope_5_and_polyscope_x_are_distinguished(tmp_path: Path, ur: URController) -> None:
    assert (
        "dashboard server: URSoftware 5.12"
        in by_name(examine(ur_cell(tmp_path, ur)), "UR controller").line()
    )
    arm = standing("ur5e")
    with URController(arm, own_address(), robot_api_port=8080) as newer:
        cell = cell_with(
            tmp_path,
            f"{{driver: ur, model: ur5e, address: {newer.address}, robot_api_port: 8080}}",
        )
        findings = examine(cell)
        assert not [finding.line() for finding in findings if finding.blocks]
        assert "PolyScope X, robot API 5.0.107" in by_name(findings, "UR controller").line()
        newer.remote_control = False
        assert "safety screen" in by_name(examine(cell), "UR remote control").line()


def test_a_robot_in_local_mode_is_named(tmp_path: Path, ur: URController) -> None:
    ur.remote_control = False
    findings = examine(ur_cell(tmp_path, ur))
    remote = by_name(findings, "UR remote control")
    assert remote.blocks
    assert "switch the pendant from Local to Remote" in remote.line()
    assert by_name(findings, "UR safety").ready
    assert by_name(findings, "UR mode").ready


def test_a_protective_stop_and_a_tool_in_millimetres_are_named(
    tmp_path: Path, ur: URController
) -> None:
    ur.protective_stop()
    ur.tcp_offset = (0.0, 0.0, 150.0, 0.0, 0.0, 0.0)
    findings = examine(ur_cell(tmp_path, ur))
    assert by_name(findings, "UR safety").blocks
    assert "mistake of units" in by_name(findings, "UR tool").line()


def test_settings_that_differ_from_the_cell_file_are_in_the_way(
    tmp_path: Path, ur: URController
) -> None:
    more = "payload_kg: 1.2, tcp: {p_m: [0, 0, 0.1], rpy_deg: [0, 0, 0]}"
    cell = cell_with(tmp_path, f"{{driver: ur, model: ur5e, address: {ur.address}, {more}}}")
    ur.joint_limits_rad[3] = [-1.0, 1.0]
    findings = [finding for finding in examine(cell) if finding.blocks]
    assert [finding.name for finding in findings] == [
        "UR joint limits",
        "UR tool centre point as in the cell file",
        "UR payload as in the cell file",
    ]
    assert "joint_limits_deg.joint_4" in findings[0].line()
    ur.joint_limits_rad[3] = [-7.0, 7.0]
    ur.tcp_offset, ur.payload_kg = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0), 1.2
    assert not [finding.line() for finding in examine(cell) if finding.blocks]


@pytest.fixture
def abb() -> Iterator[ABBController]:
    arm = standing("irb140")
    with ABBController(arm, own_address()) as controller:
        yield controller


def abb_cell(
    folder: Path, controller: ABBController, more: str = "factory_password: true"
) -> CellFile:
    address = f"{controller.address}:{controller.port}"
    return cell_with(folder, f"{{driver: abb, model: irb140, address: '{address}', {more}}}")


def test_an_abb_arm_in_manual_mode_is_named(tmp_path: Path, abb: ABBController) -> None:
    cell = abb_cell(tmp_path, abb)
    assert not [finding.line() for finding in examine(cell) if finding.blocks]
    abb.to_manual()
    assert "turn the key to automatic" in by_name(examine(cell), "ABB mode").line()


def test_a_controller_that_does_not_watch_the_link_is_named(
    tmp_path: Path, abb: ABBController
) -> None:
    limits = abb.watch.values["limit"] = 7.0
    assert by_name(examine(abb_cell(tmp_path, abb)), "ABB link watch").ready
    assert abb.watch.values["limit"] == limits  # the doctor changes nothing
    abb.watch.running = False
    assert "restart the controller" in by_name(examine(abb_cell(tmp_path, abb)), "ABB link").line()
    abb.watch.loaded = False
    assert by_name(examine(abb_cell(tmp_path, abb)), "ABB link watch").blocks
    without = by_name(
        examine(abb_cell(tmp_path, abb, "factory_password: true, link_watch: false")),
        "ABB link watch",
    )
    assert not without.blocks
    assert "a cut cable stops nothing" in without.line()


def test_robotware_6_and_robotware_7_are_distinguished(tmp_path: Path, abb: ABBController) -> None:
    assert "RobotWare 6" in by_name(examine(abb_cell(tmp_path, abb)), "ABB controller").line()
    arm = standing("irb140")
    with ABBController(arm, own_address(), omnicore=True) as newer:
        login = by_name(examine(abb_cell(tmp_path, newer)), "ABB login")
        assert login.blocks
        shown = certificate_of(newer.address, newer.port)
        assert f"certificate_sha256: {shown}" in login.line()
        more = f"factory_password: true, certificate_sha256: {shown}"
        findings = examine(abb_cell(tmp_path, newer, more))
        assert not [finding.line() for finding in findings if finding.blocks]
        assert "RobotWare 7" in by_name(findings, "ABB controller").line()
        assert by_name(findings, "ABB HTTPS").ready


def test_a_wrong_password_is_named(tmp_path: Path, abb: ABBController) -> None:
    credentials = tmp_path / "credentials"
    credentials.write_text("Default User\nwrong\n")
    findings = examine(abb_cell(tmp_path, abb, f"credentials_file: {credentials}"))
    login = by_name(findings, "ABB login")
    assert login.blocks
    assert "password is wrong" in login.line()


@pytest.fixture
def gige() -> Iterator[GigEPeer]:
    def picture(camera: CallableCamera) -> np.ndarray:
        return np.zeros((48, 64), np.uint8)

    with GigEPeer(CallableCamera(picture), 64, 48, address=own_address(), model="Eye1") as peer:
        yield peer


def gige_cell(folder: Path, peer: GigEPeer, more: str = "") -> CellFile:
    return cell_with(folder, camera=f"{{driver: gige, address: {peer.address}{more}, model: eye")


def test_a_gige_camera_reports_its_name_and_that_it_is_free(tmp_path: Path, gige: GigEPeer) -> None:
    findings = examine(gige_cell(tmp_path, gige))
    assert "Eye1" in by_name(findings, "GigE camera").found
    assert by_name(findings, "GigE control").found == "free"
    assert by_name(findings, "packet size").ready


def test_a_camera_held_by_another_program_is_named(tmp_path: Path, gige: GigEPeer) -> None:
    other = AravisCamera(gige.address)
    other.connect()
    held = by_name(examine(gige_cell(tmp_path, gige)), "GigE control")
    other.close()
    assert held.blocks
    assert "close the vendor's viewer" in held.line()
    assert by_name(examine(gige_cell(tmp_path, gige)), "GigE control").ready


def test_packets_and_buffers_that_are_too_small_are_named(
    tmp_path: Path, gige: GigEPeer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cell.verbs.doctor.gige.packet_bytes_for", lambda address: 1500)
    monkeypatch.setattr(aravis_network, "receive_buffer_limit_bytes", lambda: 1000)
    findings = examine(gige_cell(tmp_path, gige))
    assert "MTU" in by_name(findings, "packet size").line()
    assert "net.core.rmem_max" in by_name(findings, "socket buffer").line()
    too_long = by_name(examine(gige_cell(tmp_path, gige, ", packet_bytes: 9000")), "packet size")
    assert too_long.blocks
    assert "the network carries 1500" in too_long.line()


def test_a_camera_that_is_mute_is_in_the_way(tmp_path: Path, gige: GigEPeer) -> None:
    gige.faults.mute = True
    assert "check power" in by_name(examine(gige_cell(tmp_path, gige)), "GigE camera").line()


@pytest.mark.parametrize("has_settings", [True, False])
def test_a_robotiq_camera_whose_focus_cannot_be_locked_is_reported(
    tmp_path: Path, has_settings: bool
) -> None:
    source = CallableCamera(lambda camera: np.zeros((48, 64), np.uint8))
    with RobotiqPeer(source, has_settings=has_settings) as peer:
        camera = f"{{driver: robotiq, address: '{peer.address}', model: wrist"
        settings = by_name(examine(cell_with(tmp_path, camera=camera)), "Robotiq settings")
    assert settings.ready is has_settings
    assert has_settings or "focus cannot be locked" in settings.line()


def test_a_cache_that_cannot_be_written_is_in_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    assert "export NUMBA_CACHE_DIR" in by_name(examine(), "numba cache").line()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "new" / "cache"))
    assert by_name(examine(), "numba cache").ready


def test_a_missing_producer_is_in_the_way(tmp_path: Path) -> None:
    camera = "{driver: genicam, producer: /nowhere/coaxlink.cti, model: eye"
    finding = by_name(examine(cell_with(tmp_path, camera=camera)), "GenTL producer")
    assert finding.blocks
    assert "/nowhere/coaxlink.cti is not there" in finding.line()


def test_an_abb_arm_is_held_to_the_limits_of_its_own_model(tmp_path: Path) -> None:
    robot = "{driver: abb, model: irb120, address: 10.0.0.1, factory_password: true}"
    limits_rad = arm_of(cell_with(tmp_path, robot))._settings.joint_limits_rad
    assert np.array(limits_rad) == pytest.approx(kinematics_of("irb120").limits_rad)


def test_the_driver_follows_the_cell_file(tmp_path: Path) -> None:
    ur = cell_with(tmp_path, "{driver: ur, model: ur5e, address: 10.0.0.1}")
    abb = cell_with(
        tmp_path,
        "{driver: abb, model: irb140, address: 10.0.0.1, factory_password: true}",
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
