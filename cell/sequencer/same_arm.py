"""Whether the arm that is connected is the one the cell file names: asked before the first move."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.kinematics import ArmKinematics
from calib.views import FloatArray
from cell.errors import InputError
from drivers.arm import ArmState
from drivers.errors import SafetyError

MOST_M, MOST_RAD = 0.010, float(np.radians(1.5))
"""A factory calibration moves a flange by up to 4 mm and 0.6 degrees against the drawing (a UR10e
whose controller's own parameters are public); another model by 19 mm (UR3, UR3e) and more."""

_NAMES_OF = {"ur7e": {"7", "5"}, "ur12e": {"12", "10"}}
"""Sizes that a controller may call an arm by which is sold under a newer name."""


@dataclass(frozen=True)
class Difference:
    """Reported flange against the kinematics the cell file names.

    Attributes
    ----------
    position_m, rotation_rad:
        How far the two poses are apart.
    reported, computed:
        The two poses, base_from_flange.
    """

    position_m: float
    rotation_rad: float
    reported: RigidTransform
    computed: RigidTransform

    @property
    def same(self) -> bool:
        """Small enough for a factory calibration."""
        return self.position_m <= MOST_M and self.rotation_rad <= MOST_RAD

    def __str__(self) -> str:
        return f"{1e3 * self.position_m:.1f} mm and {np.degrees(self.rotation_rad):.2f}°"


def flange_difference(
    arm: ArmKinematics, joints_rad: FloatArray, reported: RigidTransform
) -> Difference:
    """How far a reported flange pose is from that of the reported (J,) joints."""
    computed = RigidTransform.from_matrix(arm.forward(np.asarray(joints_rad, float)))
    shift = float(np.linalg.norm(computed.translation - reported.translation))
    turn: Rotation = computed.rotation.inv() * reported.rotation
    return Difference(shift, float(turn.magnitude()), reported, computed)


def check_same_arm(arm: ArmKinematics, state: ArmState) -> None:
    """Hold what the controller says against the arm that the cell file names.

    Raises
    ------
    InputError
        Another number of joints.
    SafetyError
        Another model, or the reported flange is not where the named arm would have it.
    """
    refused = model_differs(arm.name, state.raw.get("model"))
    if refused:
        raise SafetyError(f"{refused}. {_REMEDY}")
    if state.joints_rad is None:
        return
    if len(state.joints_rad) != len(arm.dh):
        raise InputError(
            f"the controller reports {len(state.joints_rad)} joints, robot.model {arm.name} has"
            f" {len(arm.dh)}"
        )
    found = flange_difference(arm, np.array(state.joints_rad), state.base_from_flange)
    if not found.same:
        raise SafetyError(
            f"this is not the arm of the cell file: at the joints it reports, a {arm.name}'s flange"
            f" is at {_place(found.computed)}, the controller's own says {_place(found.reported)}:"
            f" {found} apart, a factory calibration makes a few millimetres. {_REMEDY}"
        )


_REMEDY = (
    "Write the model that is connected at robot.model and plan anew, or correct robot.address; the"
    " tool offset of the controller does not matter here"
)


def model_differs(named: str, controller_model: object) -> str:
    """Both names, where the controller calls its arm by another size; empty where they agree.

    Controllers of Universal Robots leave the e-Series' letter away, so sizes are compared only.
    """
    if not (isinstance(controller_model, str) and named.startswith("ur")):
        return ""
    size = re.search(r"ur\s*(\d+)", controller_model.lower())
    known = _NAMES_OF.get(named, set(re.findall(r"\d+", named)))
    if size is None or size[1] in known:
        return ""
    return (
        f"the cell file says robot.model {named}, the controller calls its arm {controller_model}"
    )


def _place(pose: RigidTransform) -> str:
    x, y, z = pose.translation
    return f"x={x:.3f} y={y:.3f} z={z:.3f} m"
