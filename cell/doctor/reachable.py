"""Whether the devices of a cell answer and would let themselves be driven; nothing is moved."""

from __future__ import annotations

import socket
import struct
from pathlib import Path

from cell.doctor.finding import Finding
from cell.files.camera_file import GenicamCamera, GigeCamera, RobotiqCamera
from cell.files.cell_file import AbbRobot, CellFile, UniversalRobot
from drivers.aravis_network import GVCP_PORT, packet_bytes_for
from drivers.errors import DeviceUnreachable

_TIMEOUT_S = 2.0
_JUMBO_BYTES = 8000
_UR_PORTS = {29999: "dashboard", 30003: "script", 30004: "RTDE"}
_CHECK_LINE = "check power, cable, address and firewall"


def reachable(cell: CellFile) -> list[Finding]:
    """Ask the arm and the camera that a cell file names."""
    return [*_robot(cell), *_camera(cell)]


def _robot(cell: CellFile) -> list[Finding]:
    robot = cell.robot
    if isinstance(robot, UniversalRobot):
        ports = [_port(f"UR {name}", robot.address, port) for port, name in _UR_PORTS.items()]
        return ports + (_ur_state(robot.address) if ports[0].ready else [])
    if isinstance(robot, AbbRobot):
        host, port = _host_port(robot.address, 80)
        return [_port("ABB Robot Web Services", host, port)]
    return [Finding("arm", True, f"simulated {robot.model}")]


def _ur_state(address: str) -> list[Finding]:
    from drivers.ur.dashboard import Dashboard

    dashboard = Dashboard(address)
    try:
        remote = dashboard.ask("is in remote control")
        safety = dashboard.ask("safetystatus")
        mode = dashboard.ask("robotmode")
    except DeviceUnreachable as silent:
        return [Finding("UR dashboard", False, str(silent), _CHECK_LINE)]
    finally:
        dashboard.close()
    return [
        Finding(
            "UR remote control",
            "false" not in remote.lower(),
            remote,
            "switch the pendant from Local to Remote",
        ),
        Finding(
            "UR safety",
            "NORMAL" in safety or "REDUCED" in safety,
            safety,
            "look why it stopped, then release it at the pendant",
        ),
        Finding(
            "UR mode",
            "RUNNING" in mode,
            mode,
            "power on and release the brakes at the pendant",
        ),
    ]


def _camera(cell: CellFile) -> list[Finding]:
    camera = cell.camera
    if isinstance(camera, GigeCamera):
        return [_gige(camera.address), _packets(camera.address)]
    if isinstance(camera, RobotiqCamera):
        host, port = _host_port(camera.address, 4242)
        return [_port("Robotiq camera server", host, port)]
    if isinstance(camera, GenicamCamera):
        there = Path(camera.producer).is_file()
        found = str(camera.producer) if there else f"{camera.producer} is not there"
        mend = "install the grabber's software and give the path of its .cti file"
        return [Finding("GenTL producer", there, found, mend)]
    return [Finding("camera", True, f"simulated {camera.width} x {camera.height}")]


def _gige(address: str) -> Finding:
    """Ask one address for its discovery record (GigE Vision GVCP, command 0x0002)."""
    name = f"GigE camera {address}"
    ask = struct.pack(">BBHHH", 0x42, 0x01, 0x0002, 0, 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.settimeout(_TIMEOUT_S)
        try:
            link.sendto(ask, (address, GVCP_PORT))
            reply = link.recv(1024)
        except OSError as silent:
            return Finding(name, False, f"does not answer ({silent})", _CHECK_LINE)
    vendor, model = (_text(reply[8 + at : 8 + at + 32]) for at in (72, 104))
    return Finding(name, True, f"{vendor} {model}".strip() or "answers")


def _packets(address: str) -> Finding:
    try:
        size = packet_bytes_for(address)
    except OSError as fault:
        return Finding("packet size", False, str(fault), _CHECK_LINE)
    mend = "set the MTU of that network card (and of switches between) to 9000"
    ready = size >= _JUMBO_BYTES
    return Finding("packet size", ready, f"{size} bytes", mend, needed=False)


def _port(name: str, host: str, port: int) -> Finding:
    name = f"{name} {host}:{port}"
    try:
        with socket.create_connection((host, port), _TIMEOUT_S):
            return Finding(name, True, "answers")
    except OSError as silent:
        return Finding(name, False, f"does not answer ({silent})", _CHECK_LINE)


def _host_port(address: str, port: int) -> tuple[str, int]:
    host, _, given = address.partition(":")
    return host, int(given) if given.isdecimal() else port


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("latin-1")
