"""Universal Robots arms."""

from drivers.ur.arm import URArm
from drivers.ur.settings import URSettings

__all__ = ["URArm", "URSettings"]
