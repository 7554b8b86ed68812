"""Serial arms: forward and inverse kinematics, Jacobian, limits, gravity torques.

``arm("ur5e")`` gives the nominal kinematics of a model; `MODELS` names them all.
"""

from calib.chain.kinematics.arm import ArmKinematics, OutOfReach
from calib.chain.kinematics.models import MODELS, UnknownArm, arm

__all__ = ["MODELS", "ArmKinematics", "OutOfReach", "UnknownArm", "arm"]
