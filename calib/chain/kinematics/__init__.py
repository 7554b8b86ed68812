"""Serial arms: forward and inverse kinematics, Jacobian, limits, gravity torques.

``arm("ur5e")`` gives the nominal kinematics of a model; `MODELS` names them all. `arm_from_urdf`
reads any other six-joint arm, `adopt` makes it known by its name.
"""

from calib.chain.kinematics.arm import ArmKinematics, OutOfReach
from calib.chain.kinematics.models import MODELS, UnknownArm, adopt, arm
from calib.chain.kinematics.urdf import UnusableUrdf, arm_from_urdf, joint_names

__all__ = [
    "MODELS",
    "ArmKinematics",
    "OutOfReach",
    "UnknownArm",
    "UnusableUrdf",
    "adopt",
    "arm",
    "arm_from_urdf",
    "joint_names",
]
