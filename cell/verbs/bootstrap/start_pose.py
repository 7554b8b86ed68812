"""Where the arm stands before anything moves."""

from __future__ import annotations

from calib.chain.kinematics import ArmKinematics
from calib.views import FloatArray
from cell.sequencer.confirmed_stop import ConfirmedStop
from cell.sequencer.same_arm import check_same_arm
from cell.sequencer.sequencer import Devices
from cell.sequencer.watched_arm import joints_of
from drivers.errors import StopFailed


def start_joints_rad(devices: Devices, named: ArmKinematics) -> FloatArray:
    """(6,) joint angles, read over a link of its own, of the arm that the cell file names.

    Raises
    ------
    DeviceError
        No link, or no joint angles.
    SafetyError
        Another arm than the named one.
    StopFailed
        Readings do not confirm that it stands.
    """
    arm = devices.arm
    try:
        arm.connect()
        word = ConfirmedStop(arm, devices.clock).see_through()
        if not word.stands:
            raise StopFailed(word.text)
        state = arm.state()
        check_same_arm(named, state)
        return joints_of(state)
    finally:
        arm.close()
