"""Whether the devices of a cell answer and would let themselves be driven; nothing is moved."""

from __future__ import annotations

import time
from pathlib import Path

from cell.storage.files.camera_file import GenicamCamera, GigeCamera, RobotiqCamera
from cell.storage.files.cell_file import AbbRobot, CellFile, UniversalRobot
from cell.verbs.doctor.abb import abb
from cell.verbs.doctor.finding import Finding
from cell.verbs.doctor.gige import gige
from cell.verbs.doctor.ports import host_port, port
from cell.verbs.doctor.universal_robot import universal_robot
from drivers.errors import DeviceError

_SETTINGS_S = 3.0


def reachable(cell: CellFile) -> list[Finding]:
    """Ask the arm and the camera that a cell file names."""
    return [*_robot(cell), *_camera(cell)]


def _robot(cell: CellFile) -> list[Finding]:
    robot = cell.robot
    if isinstance(robot, UniversalRobot):
        return [*universal_robot(robot, cell.joint_limits_deg), _payload(cell)]
    if isinstance(robot, AbbRobot):
        return [*abb(robot), _payload(cell)]
    return [Finding("arm", True, f"simulated {robot.model}")]


def _payload(cell: CellFile) -> Finding:
    given = cell.robot.payload_kg
    return Finding(
        "payload",
        given > 0,
        f"{given:g} kg in the cell file",
        "weigh camera and bracket, write robot.payload_kg, and set the same at the pendant: an arm"
        " that does not know its load sags and trips",
        needed=False,
    )


def _camera(cell: CellFile) -> list[Finding]:
    camera = cell.camera
    if isinstance(camera, GigeCamera):
        return gige(camera)
    if isinstance(camera, RobotiqCamera):
        return _robotiq(camera)
    if isinstance(camera, GenicamCamera):
        there = Path(camera.producer).is_file()
        found = str(camera.producer) if there else f"{camera.producer} is not there"
        mend = "install the grabber's software and give the path of its .cti file"
        return [Finding("GenTL producer", there, found, mend)]
    return [Finding("camera", True, f"simulated {camera.width} x {camera.height}")]


def _robotiq(camera: RobotiqCamera) -> list[Finding]:
    from drivers.robotiq_http import PORT, RobotiqHttp

    host, number = host_port(camera.address, PORT)
    server = port("Robotiq camera server", host, number)
    if not server.ready:
        return [server]
    http = RobotiqHttp(host, number)
    try:
        settings = http.settings(time.monotonic() + _SETTINGS_S)
    except DeviceError as silent:
        return [server, Finding("Robotiq settings", False, str(silent), "start the URCap again")]
    finally:
        http.close()
    return [
        server,
        Finding(
            "Robotiq settings",
            settings is not None,
            "none in this firmware" if settings is None else "exposure, gain and focus",
            "update the URCap: without them the focus cannot be locked and moves by itself",
            needed=False,
        ),
    ]
