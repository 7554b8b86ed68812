"""ABB arms on an IRC5."""

from drivers.abb.arm import ABBArm
from drivers.abb.login import FACTORY_LOGIN, Login
from drivers.abb.settings import ABBSettings

__all__ = ["FACTORY_LOGIN", "ABBArm", "ABBSettings", "Login"]
