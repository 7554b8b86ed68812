"""Where the arm stands before anything moves."""

from __future__ import annotations

from calib.views import FloatArray
from cell.sequencer.confirmed_stop import ConfirmedStop
from cell.sequencer.sequencer import Devices
from cell.sequencer.watched_arm import joints_of
from drivers.errors import StopFailed


def where_it_stands(devices: Devices) -> FloatArray:
    """(6,) joint angles, read over a link of its own.

    Raises
    ------
    DeviceError
        No link, or no joint angles.
    StopFailed
        Readings do not confirm that it stands.
    """
    arm = devices.arm
    try:
        arm.connect()
        word = ConfirmedStop(arm, devices.clock).see_through()
        if not word.stands:
            raise StopFailed(word.text)
        return joints_of(arm.state())
    finally:
        arm.close()
