"""ABB arms on an IRC5."""

from drivers.abb.arm import ABBArm
from drivers.abb.settings import ABBSettings

__all__ = ["ABBArm", "ABBSettings"]
