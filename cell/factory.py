"""Arm and camera of a plan: the only place that knows which driver is which.

Drivers are imported when they are needed, so that a cell without a UR arm needs no `ur-rtde`.
"""

from __future__ import annotations

from cell.errors import InputError
from cell.files.cell_file import (
    AbbRobot,
    CellFile,
    GenicamCamera,
    GigeCamera,
    RobotiqCamera,
    UniversalRobot,
)
from cell.files.plan_file import Plan
from cell.sequencer.sequencer import Devices
from drivers.arm import Arm
from drivers.camera import Camera


def simulated_devices(plan: Plan, *, seed: int | None = None) -> Devices:
    """Simulated arm and camera in the place of a plan's own; raises `InputError`."""
    from cell.log_slips import SLIPS
    from cell.simulated import home_of, simulated_cell
    from sim.build import build
    from sim.clock import SimClock

    truth = plan.cell.simulation
    slips = [effect.name for effect in truth.effects if effect.name in SLIPS] if truth else []
    if slips:
        raise InputError(
            f"cell {plan.cell.name}: {', '.join(slips)} is a slip of the log, and this log is true;"
            " `cell simulate` without --images can make it"
        )
    clock = SimClock()
    arm, camera = build(simulated_cell(plan.cell, home_of(plan), seed=seed), clock)
    return Devices(arm, camera, clock)


def real_devices(plan: Plan) -> Devices:
    """The drivers a plan's cell names, not yet connected.

    Raises
    ------
    InputError
        Arm or camera is a simulated one.
    """
    return Devices(arm_of(plan.cell), camera_of(plan.cell))


def arm_of(cell: CellFile) -> Arm:
    """The driver of a cell's arm, not yet connected; raises `InputError` for a simulated one."""
    robot = cell.robot
    if isinstance(robot, UniversalRobot):
        from drivers.ur import URArm, URSettings

        return URArm(robot.address, URSettings(upper_registers=robot.upper_registers))
    if isinstance(robot, AbbRobot):
        from drivers.abb import ABBArm, ABBSettings

        settings = ABBSettings(robot.user, robot.password, egm_port=robot.egm_port)
        return ABBArm(f"http://{robot.address}", settings)
    raise InputError(_only_simulated(cell, "arm"))


def camera_of(cell: CellFile) -> Camera:
    """The driver of a cell's camera, not yet connected; raises `InputError` for a simulated one."""
    camera = cell.camera
    if isinstance(camera, GigeCamera):
        from drivers.aravis import AravisCamera
        from drivers.genicam_camera import GenICamOptions

        options = GenICamOptions(pixel_format=camera.pixel_format, features=camera.features)
        return AravisCamera(camera.address, options)
    if isinstance(camera, GenicamCamera):
        from drivers.genicam import GenTLCamera
        from drivers.genicam_camera import GenICamOptions

        options = GenICamOptions(pixel_format=camera.pixel_format, features=camera.features)
        select = {"serial_number": camera.serial} if camera.serial else None
        return GenTLCamera(str(camera.producer), select, options)
    if isinstance(camera, RobotiqCamera):
        from drivers.robotiq import RobotiqCamera as Driver

        return Driver(camera.address)
    raise InputError(_only_simulated(cell, "camera"))


def _only_simulated(cell: CellFile, device: str) -> str:
    return (
        f"cell {cell.name}: its {device} is simulated (driver: sim). Run it with --dry-run,"
        " or write the real driver and its address into the cell file."
    )
