"""The arms known by name: geometry, limits, speeds, masses, each with its source.

Universal Robots: "DH Parameters for calculations of kinematics and dynamics"
(universal-robots.com), which also states link masses and centres of mass; joint limits and
speeds from the user manuals. A joint may turn 360 degrees either way, but the elbow strikes the
upper arm before half a turn, so it is held to that here.
ABB: IRB 140 product specification (lengths, ranges, speeds at 400 V).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from calib.chain.kinematics.arm import ArmKinematics
from calib.chain.kinematics.gravity import LinkMasses
from calib.chain.kinematics.inverse_spherical_wrist import spherical_wrist_branches
from calib.chain.kinematics.inverse_ur import ur_branches
from calib.views import FloatArray

Point = tuple[float, float, float]


class UnknownArm(ValueError):
    """No arm of that name is known."""


# d1, a2, a3, d4, d5, d6 in metres
_UR_LENGTHS_M = {
    "ur3": (0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819),
    "ur3e": (0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921),
    "ur5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
    "ur10": (0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922),
    "ur10e": (0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655),
    "ur16e": (0.1807, -0.4784, -0.36, 0.17415, 0.11985, 0.11655),
}

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
_UR_MASSES: dict[str, tuple[tuple[float, ...], tuple[Point, ...]]] = {
    "ur3": ((2.0, 3.42, 1.26, 0.8, 0.8, 0.35), _SMALL_COM_M),
    "ur3e": ((1.98, 3.4445, 1.437, 0.871, 0.805, 0.261), _SMALL_COM_M),
    "ur5": ((3.7, 8.393, 2.33, 1.219, 1.219, 0.1879), _MIDDLE_COM_M),
    "ur5e": ((3.761, 8.058, 2.846, 1.37, 1.3, 0.365), _MIDDLE_COM_M),
    "ur10": ((7.1, 12.7, 4.27, 2.0, 2.0, 0.365), _LARGE_COM_M),
    "ur10e": ((7.369, 13.051, 3.989, 2.1, 1.98, 0.615), _LARGE_COM_M),
    "ur16e": ((7.369, 10.45, 4.321, 2.18, 2.033, 0.907), _UR16E_COM_M),
}
_UR_REACH_M = {
    "ur3": 0.5,
    "ur3e": 0.5,
    "ur5": 0.85,
    "ur5e": 0.85,
    "ur10": 1.3,
    "ur10e": 1.3,
    "ur16e": 0.9,
}
_UR_SPEED_DEG_S = {
    "ur3": (180, 180, 180, 360, 360, 360),
    "ur3e": (180, 180, 180, 360, 360, 360),
    "ur5": (180,) * 6,
    "ur5e": (180,) * 6,
    "ur10": (120, 120, 180, 180, 180, 180),
    "ur10e": (120, 120, 180, 180, 180, 180),
    "ur16e": (120, 120, 180, 180, 180, 180),
}

_HALF = np.pi / 2

# Zero pose: flange 0.515 m in front, 0.712 m up, its z axis forward (tool0 = Ry(90 deg)).
_IRB140_DH = np.array(
    [
        [0.0, 0.352, 0.070, -_HALF],
        [-_HALF, 0.0, 0.360, 0.0],
        [0.0, 0.0, 0.0, -_HALF],
        [0.0, 0.380, 0.0, _HALF],
        [0.0, 0.0, 0.0, -_HALF],
        [np.pi, 0.065, 0.0, 0.0],
    ]
)
_IRB140_LIMITS_DEG = ((-180, 180), (-90, 110), (-230, 50), (-200, 200), (-115, 115), (-400, 400))
_IRB140_SPEED_DEG_S = (200, 200, 260, 360, 360, 450)
# ABB states only the whole arm's 98 kg. An estimate: a third stays in the foot, the rest is
# shared along the arm as in arms of this build, each mass halfway along its link.
_IRB140_MASSES = LinkMasses(
    mass_kg=np.array([27.0, 14.0, 15.0, 5.0, 1.5, 0.3]),
    com_m=np.array(
        [
            [-0.03, 0.06, 0.0],
            [-0.18, 0.0, 0.0],
            [0.0, 0.0, 0.05],
            [0.0, -0.12, 0.0],
            [0.0, 0.0, 0.0],
            [0.0, 0.0, -0.01],
        ]
    ),
    published=False,
)

MODELS = (*_UR_LENGTHS_M, "irb140")


@cache
def arm(name: str) -> ArmKinematics:
    """Nominal kinematics of a model (see `MODELS`); raises `UnknownArm`."""
    if name == "irb140":
        return _irb140()
    if name in _UR_LENGTHS_M:
        return _universal_robot(name)
    raise UnknownArm(
        f"no kinematics known for robot model {name!r}: use one of {', '.join(MODELS)}"
    )


def _universal_robot(name: str) -> ArmKinematics:
    mass_kg, com_m = _UR_MASSES[name]
    limits = np.full((6, 2), 2 * np.pi) * [-1.0, 1.0]
    limits[2] = [-np.pi, np.pi]
    return ArmKinematics(
        name=name,
        dh=_universal_robot_dh(*_UR_LENGTHS_M[name]),
        limits_rad=limits,
        max_speed_rad_s=np.radians(_UR_SPEED_DEG_S[name]),
        reach_m=_UR_REACH_M[name],
        masses=LinkMasses(np.array(mass_kg), np.array(com_m), published=True),
        inverse_branches=ur_branches,
    )


def _universal_robot_dh(
    d1: float, a2: float, a3: float, d4: float, d5: float, d6: float
) -> FloatArray:
    return np.array(
        [
            [0.0, d1, 0.0, _HALF],
            [0.0, 0.0, a2, 0.0],
            [0.0, 0.0, a3, 0.0],
            [0.0, d4, 0.0, _HALF],
            [0.0, d5, 0.0, -_HALF],
            [0.0, d6, 0.0, 0.0],
        ]
    )


def _irb140() -> ArmKinematics:
    return ArmKinematics(
        name="irb140",
        dh=_IRB140_DH,
        limits_rad=np.radians(_IRB140_LIMITS_DEG),
        max_speed_rad_s=np.radians(_IRB140_SPEED_DEG_S),
        reach_m=0.81,
        masses=_IRB140_MASSES,
        inverse_branches=spherical_wrist_branches,
    )
