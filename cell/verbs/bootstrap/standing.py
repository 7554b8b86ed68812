"""Where the arm stands before anything moves, and whether its model says the same."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.views import FloatArray
from cell.errors import InputError
from cell.sequencer.confirmed_stop import ConfirmedStop
from cell.sequencer.guard import Guard
from cell.sequencer.sequencer import Devices
from cell.sequencer.watched_arm import joints_of
from drivers.arm import ArmState
from drivers.errors import StopFailed

_MODEL_M = 0.01
_MODEL_RAD = float(np.radians(1.0))
"""A controller's own calibration moves its arm by millimetres; another model by centimetres."""


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


def check_model(guard: Guard, state: ArmState) -> None:
    """Raise `InputError` where the logged flange is not where the model's joints put it."""
    by_model = RigidTransform.from_matrix(guard.kinematics.forward(joints_of(state)))
    off = by_model.inv() * state.base_from_flange
    moved_m = float(np.linalg.norm(off.translation))
    turned_rad = float(off.rotation.magnitude())
    if moved_m > _MODEL_M or turned_rad > _MODEL_RAD:
        raise InputError(
            f"cell {guard.cell.name}: robot.model: a {guard.cell.robot.model} with these joint"
            f" angles has its flange {1e3 * moved_m:.0f} mm and {np.degrees(turned_rad):.1f}° from"
            " where the controller says it is. Correct the model (or the controller's base and"
            " tool frames); the arm is not moved by a wrong one."
        )
