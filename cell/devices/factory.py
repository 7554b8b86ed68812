"""Arm and camera of a plan: the only place that knows which driver is which.

Drivers are imported when they are needed, so that a cell without a UR arm needs no `ur-rtde`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

from calib.chain.kinematics import UnknownArm, arm
from cell.devices.genicam_options import genicam_options
from cell.devices.interrupted_run import remember_run
from cell.errors import InputError
from cell.sequencer.bounded import check_bounded
from cell.sequencer.sequencer import Devices
from cell.storage.files.camera_file import (
    GenicamCamera,
    GigeCamera,
    RobotiqCamera,
)
from cell.storage.files.cell_file import AbbRobot, CellFile, UniversalRobot
from cell.storage.files.plan_file import Plan
from drivers.arm import Arm
from drivers.camera import Camera
from drivers.errors import DeviceRefused
from sim.cell import SimulatedCell


def simulated_devices(plan: Plan, *, seed: int | None = None) -> Devices:
    """Simulated arm and camera in the place of a plan's own; raises `InputError`."""
    from sim.build import build
    from sim.clock import SimClock

    clock = SimClock()
    arm, camera = build(_true_cell(plan, seed), clock)
    return Devices(arm, camera, clock, partial(remember_run, arm, camera, clock))


@contextmanager
def peer_devices(plan: Plan) -> Iterator[Devices]:
    """The real drivers, in front of simulated devices that speak the real ones' protocols.

    The arm's driver follows the robot's model: ABB's for the IRB 140, Universal Robots' for the
    others. The camera's is Robotiq's where the cell's camera is theirs, and Aravis' for any other.
    The devices live until the context is left.

    Raises
    ------
    InputError
        The cell cannot be simulated, or the peers cannot listen here.
    DeviceRefused
        A package of these drivers is not installed.
    """
    from cell.devices.peers import peers

    truth = _true_cell(plan, None)
    is_abb = (plan.cell.robot.model or "").startswith("irb")
    is_robotiq = "robotiq" in f"{plan.cell.camera.driver} {plan.cell.camera.model}".lower()
    if not is_robotiq:
        _require_aravis()
    with peers(truth, "abb" if is_abb else "ur", "robotiq" if is_robotiq else "gige") as at:
        arm = _abb_at(at.arm) if is_abb else _ur_at(at.arm)
        yield Devices(arm, _robotiq_at(at.camera) if is_robotiq else _gige_at(at.camera, plan))


def _true_cell(plan: Plan, seed: int | None) -> SimulatedCell:
    from cell.devices.log_mixups import MIXUPS
    from cell.devices.simulated_cell import home_of, simulated_cell

    truth = plan.cell.simulation
    mixups = [effect.name for effect in truth.effects if effect.name in MIXUPS] if truth else []
    if mixups:
        raise InputError(
            f"cell {plan.cell.name}: {', '.join(mixups)} is a mix-up in the log, and this log is"
            " true; `cell simulate` without --images can make it"
        )
    truth_of_cell = simulated_cell(plan.cell, home_of(plan), seed=seed)
    try:
        arm(truth_of_cell.robot_model)
    except UnknownArm as unknown:
        raise InputError(f"cell {plan.cell.name}: robot.model: {unknown}") from None
    return truth_of_cell


def _require_aravis() -> None:
    from drivers.aravis_session import import_aravis

    try:
        import_aravis()
    except DeviceRefused as missing:
        raise DeviceRefused(
            f"--peers drives this cell's camera through Aravis: {missing}; or leave --peers away"
        ) from None


def _ur_at(address: str) -> Arm:
    from drivers.ur import URArm, URSettings

    # no arm can come to harm, and a busy machine keeps the peers from answering, too
    return URArm(
        address, URSettings(silence_s=2.0, watchdog_hz=0.5, heartbeat_s=10.0, start_timeout_s=30.0)
    )


def _abb_at(url: str) -> Arm:
    from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings

    return ABBArm(
        url,
        ABBSettings(
            login=FACTORY_LOGIN,
            silence_s=5.0,
            link_watch_s=4.0,
            connect_timeout_s=2.0,
            read_timeout_s=4.0,
        ),
    )


def _robotiq_at(address: str) -> Camera:
    from drivers.robotiq import RobotiqCamera as Driver

    return Driver(address)


def _gige_at(address: str, plan: Plan) -> Camera:
    from drivers.aravis import AravisCamera
    from drivers.genicam_camera import GenICamOptions

    # a large picture takes longer to render than a real camera takes to send it
    return AravisCamera(address, GenICamOptions(patience_s=plan.file.exposure.timeout_s))


def real_devices(plan: Plan) -> Devices:
    """The drivers a plan's cell names, not yet connected.

    Raises
    ------
    InputError
        Arm or camera is a simulated one, or there is no login for the arm's controller.
    SafetyError
        The cell does not say where its arm may go: see `check_bounded`.
    """
    devices = Devices(arm_of(plan.cell), camera_of(plan.cell))
    check_bounded(plan.cell)
    return devices


def arm_of(cell: CellFile) -> Arm:
    """The driver of a cell's arm, not yet connected; raises `InputError` as `real_devices` does."""
    robot = cell.robot
    if isinstance(robot, UniversalRobot):
        from drivers.ur import URArm, URSettings

        settings = URSettings(
            upper_registers=robot.upper_registers, robot_api_port=robot.robot_api_port
        )
        return URArm(robot.address, settings)
    if isinstance(robot, AbbRobot):
        from cell.devices.abb_settings import abb_settings
        from drivers.abb import ABBArm

        return ABBArm(robot.address, replace(abb_settings(robot), joint_limits_rad=_limits(cell)))
    raise InputError(_only_simulated(cell, "arm"))


def _limits(cell: CellFile) -> tuple[tuple[float, float], ...]:
    """Joint limits of a cell's arm, radians; raises `InputError` for one that is not known."""
    try:
        limits_rad = arm(cell.robot.model or "").limits_rad
    except UnknownArm as unknown:
        raise InputError(f"cell {cell.name}: robot.model: {unknown}") from None
    return tuple((float(low), float(high)) for low, high in limits_rad)


def camera_of(cell: CellFile) -> Camera:
    """The driver of a cell's camera, not yet connected; raises `InputError` for a simulated one."""
    camera = cell.camera
    if isinstance(camera, GigeCamera):
        from drivers.aravis import AravisCamera

        options = genicam_options(camera)
        return AravisCamera(camera.address, options, packet_bytes=camera.packet_bytes)
    if isinstance(camera, GenicamCamera):
        from drivers.genicam import GenTLCamera

        select = {"serial_number": camera.serial} if camera.serial else None
        return GenTLCamera(str(camera.producer), select, genicam_options(camera))
    if isinstance(camera, RobotiqCamera):
        from drivers.robotiq import RobotiqCamera as Driver

        return Driver(camera.address, display_size=camera.display_size)
    raise InputError(_only_simulated(cell, "camera"))


def _only_simulated(cell: CellFile, device: str) -> str:
    return (
        f"cell {cell.name}: its {device} is simulated (driver: sim). Run it with --dry-run,"
        " or write the real driver and its address into the cell file."
    )
