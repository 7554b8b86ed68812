"""The arms known by name: geometry, limits, speeds, masses, each table with its source."""

from __future__ import annotations

from functools import cache

from calib.chain.kinematics.abb import ABB_MODELS, abb
from calib.chain.kinematics.arm import ArmKinematics
from calib.chain.kinematics.universal_robots import UR_MODELS, universal_robot

MODELS = (*UR_MODELS, *ABB_MODELS)


class UnknownArm(ValueError):
    """No arm of that name is known."""


_adopted: dict[str, ArmKinematics] = {}


def adopt(kinematics: ArmKinematics) -> None:
    """Make an arm known by its name, which no other arm may have had in this process."""
    _adopted[kinematics.name] = kinematics


def arm(name: str) -> ArmKinematics:
    """Nominal kinematics of a model (see `MODELS`), or of an arm adopted; raises `UnknownArm`."""
    return _adopted.get(name) or _of_model(name)


@cache
def _of_model(name: str) -> ArmKinematics:
    if name in ABB_MODELS:
        return abb(name)
    if name in UR_MODELS:
        return universal_robot(name)
    raise UnknownArm(
        f"no kinematics known for robot model {name!r}: use one of {', '.join(MODELS)}"
    )
