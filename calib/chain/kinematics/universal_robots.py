"""Universal Robots' arms.

Lengths, link masses and centres of mass: "DH Parameters for calculations of kinematics and
dynamics" (universal-robots.com), agreeing with the `default_kinematics.yaml` of their ROS 2
description; joint speeds from the user manuals. A joint may turn 360 degrees either way. How far
the elbow bends is a matter of the body, see `_ELBOW_DEG`.
"""

from __future__ import annotations

import numpy as np

from calib.chain.kinematics.arm import ArmKinematics
from calib.chain.kinematics.dh import rows
from calib.chain.kinematics.gravity import LinkMasses
from calib.chain.kinematics.inverse_ur import ur_branches
from calib.views import FloatArray

Point = tuple[float, float, float]

# d1, a2, a3, d4, d5, d6 in metres
_UR_LENGTHS_M = {
    "ur3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "ur3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "ur5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "ur10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "ur16e": (0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
    "ur20": (0.2363, -0.862, -0.7287, 0.201, 0.1593, 0.1543),
    "ur30": (0.2363, -0.637, -0.5037, 0.201, 0.1593, 0.1543),
}
_SOLD_AS = {"ur7e": "ur5e", "ur12e": "ur10e"}
"""Newer names of the same mechanics; the greater payload is the controller's matter."""

_SMALL_COM_M = (
    (0.0, -0.02, 0.0),
    (0.13, 0.0, 0.1157),
    (0.05, 0.0, 0.0238),
    (0.0, 0.0, 0.01),
    (0.0, 0.0, 0.01),
    (0.0, 0.0, -0.02),
)
_MIDDLE_COM_M = (
    (0.0, -0.02561, 0.00193),
    (0.2125, 0.0, 0.11336),
    (0.15, 0.0, 0.0265),
    (0.0, -0.0018, 0.01634),
    (0.0, 0.0018, 0.01634),
    (0.0, 0.0, -0.001159),
)
_LARGE_COM_M = (
    (0.021, 0.0, 0.027),
    (0.38, 0.0, 0.158),
    (0.24, 0.0, 0.068),
    (0.0, 0.007, 0.018),
    (0.0, 0.007, 0.018),
    (0.0, 0.0, -0.026),
)
_UR16E_COM_M = (
    (0.0, -0.016, 0.03),
    (0.302, 0.0, 0.16),
    (0.194, 0.0, 0.065),
    (0.0, -0.009, 0.011),
    (0.0, 0.018, 0.012),
    (0.0, 0.0, -0.044),
)
_UR20_COM_M = (
    (0.0, -0.061, 0.0062),
    (0.5226, 0.0, 0.2098),
    (0.3234, 0.0, 0.0604),
    (0.0, -0.0026, 0.0393),
    (0.0, 0.0024, 0.0379),
    (0.0, 0.0, -0.0293),
)
_UR30_COM_M = (
    (-0.0001, -0.06, 0.0069),
    (0.3894, 0.0, 0.2103),
    (0.2257, 0.0, 0.0629),
    (0.0, -0.0048, 0.0353),
    (0.0, 0.0046, 0.0341),
    (0.0, 0.0, -0.0293),
)
_UR_MASSES: dict[str, tuple[tuple[float, ...], tuple[Point, ...]]] = {
    "ur3": ((2.0, 3.42, 1.26, 0.8, 0.8, 0.35), _SMALL_COM_M),
    "ur3e": ((1.98, 3.4445, 1.437, 0.871, 0.805, 0.261), _SMALL_COM_M),
    "ur5": ((3.7, 8.393, 2.33, 1.219, 1.219, 0.1879), _MIDDLE_COM_M),
    "ur5e": ((3.761, 8.058, 2.846, 1.37, 1.3, 0.365), _MIDDLE_COM_M),
    "ur10": ((7.1, 12.7, 4.27, 2.0, 2.0, 0.365), _LARGE_COM_M),
    "ur10e": ((7.369, 13.051, 3.989, 2.1, 1.98, 0.615), _LARGE_COM_M),
    "ur16e": ((7.369, 10.45, 4.321, 2.18, 2.033, 0.907), _UR16E_COM_M),
    "ur20": ((16.343, 29.632, 7.879, 3.054, 3.126, 0.926), _UR20_COM_M),
    "ur30": ((16.343, 28.542, 7.156, 3.054, 3.126, 0.926), _UR30_COM_M),
}
_UR_REACH_M = {
    "ur3": 0.5,
    "ur3e": 0.5,
    "ur5": 0.85,
    "ur5e": 0.85,
    "ur10": 1.3,
    "ur10e": 1.3,
    "ur16e": 0.9,
    "ur20": 1.75,
    "ur30": 1.3,
}
_UR_SPEED_DEG_S = {
    "ur3": (180, 180, 180, 360, 360, 360),
    "ur3e": (180, 180, 180, 360, 360, 360),
    "ur5": (180,) * 6,
    "ur5e": (180,) * 6,
    "ur10": (120, 120, 180, 180, 180, 180),
    "ur10e": (120, 120, 180, 180, 180, 180),
    "ur16e": (120, 120, 180, 180, 180, 180),
    "ur20": (120, 120, 150, 210, 210, 210),
    "ur30": (120, 120, 150, 210, 210, 210),
}

_ELBOW_DEG = {
    "ur3": 157,
    "ur3e": 157,
    "ur5": 164,
    "ur5e": 164,
    "ur10": 166,
    "ur10e": 166,
    "ur16e": 159,
    "ur20": 170,
    "ur30": 165,
}
"""One degree before the elbow at which the collision meshes of the maker's description (see
`calib.bodies.universal_robots`) meet whatever the other joints do: shoulder against forearm. The
controller allows 360 degrees and leaves the body to whoever drives it."""

_HALF = np.pi / 2

UR_MODELS = (*_UR_LENGTHS_M, *_SOLD_AS)


def universal_robot(name: str) -> ArmKinematics:
    """Nominal kinematics of one of `UR_MODELS`."""
    built_as = _SOLD_AS.get(name, name)
    mass_kg, com_m = _UR_MASSES[built_as]
    limits = np.full((6, 2), 2 * np.pi) * [-1.0, 1.0]
    limits[2] = np.radians([-_ELBOW_DEG[built_as], _ELBOW_DEG[built_as]])
    return ArmKinematics(
        name=name,
        dh=_universal_robot_dh(*_UR_LENGTHS_M[built_as]),
        limits_rad=limits,
        max_speed_rad_s=np.radians(_UR_SPEED_DEG_S[built_as]),
        reach_m=_UR_REACH_M[built_as],
        masses=LinkMasses(np.array(mass_kg), np.array(com_m), published=True),
        inverse_branches=ur_branches,
    )


def _universal_robot_dh(
    d1: float, a2: float, a3: float, d4: float, d5: float, d6: float
) -> FloatArray:
    return rows(
        (0.0, d1, 0.0, _HALF),
        (0.0, 0.0, a2, 0.0),
        (0.0, 0.0, a3, 0.0),
        (0.0, d4, 0.0, _HALF),
        (0.0, d5, 0.0, -_HALF),
        (0.0, d6, 0.0, 0.0),
    )
