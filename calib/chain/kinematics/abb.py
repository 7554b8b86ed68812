"""ABB's arms.

IRB 140: product specification (lengths, ranges, speeds at 400 V). The others: lengths, ranges and
speeds as in the descriptions of ROS-Industrial's `abb_experimental` (Apache-2.0, commit 20b9cf86)
and `abb_ros2` (BSD-3-Clause), which give ABB's product specifications as their source.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.kinematics.arm import ArmKinematics
from calib.chain.kinematics.dh import rows
from calib.chain.kinematics.gravity import LinkMasses
from calib.chain.kinematics.inverse_spherical_wrist import spherical_wrist_branches
from calib.views import FloatArray

_HALF = np.pi / 2


@dataclass(frozen=True)
class _Drawing:
    """One arm's data sheet.

    Attributes
    ----------
    lengths_m:
        d1, a1, a2, a3, d4, d6: height of joint 2, its distance from joint 1's axis, upper arm,
        height of joint 4's axis above joint 3, forearm, wrist centre to flange.
    limits_deg, speed_deg_s:
        Of each joint.
    reach_m, mass_kg:
        The maker's figures for the whole arm.
    """

    lengths_m: tuple[float, float, float, float, float, float]
    limits_deg: tuple[tuple[float, float], ...]
    speed_deg_s: tuple[float, ...]
    reach_m: float
    mass_kg: float


def _symmetric(*limits: float | tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return tuple((-x, x) if isinstance(x, (int, float)) else x for x in limits)


_DRAWINGS = {
    "irb140": _Drawing(
        (0.352, 0.070, 0.360, 0.0, 0.380, 0.065),
        _symmetric(180, (-90, 110), (-230, 50), 200, 115, 400),
        (200, 200, 260, 360, 360, 450),
        reach_m=0.81,
        mass_kg=98.0,
    ),
    "irb120": _Drawing(
        (0.290, 0.0, 0.270, 0.070, 0.302, 0.072),
        _symmetric(165, 110, (-110, 70), 160, 120, 400),
        (250, 250, 250, 320, 320, 420),
        reach_m=0.58,
        mass_kg=25.0,
    ),
    "irb1200_5_90": _Drawing(
        (0.3991, 0.0, 0.448, 0.042, 0.451, 0.082),
        _symmetric(170, (-100, 130), (-200, 70), 270, 130, 360),
        (288, 240, 300, 400, 405, 600),
        reach_m=0.901,
        mass_kg=54.0,
    ),
    "irb1200_7_70": _Drawing(
        (0.3991, 0.0, 0.350, 0.042, 0.351, 0.082),
        _symmetric(170, (-100, 135), (-200, 70), 270, 130, 360),
        (288, 240, 300, 400, 405, 600),
        reach_m=0.703,
        mass_kg=52.0,
    ),
    "irb1600_6_12": _Drawing(
        (0.4865, 0.150, 0.475, 0.0, 0.600, 0.065),
        _symmetric(180, (-63, 110), (-235, 55), 200, 115, 400),
        (150, 160, 170, 320, 400, 450),
        reach_m=1.225,
        mass_kg=250.0,
    ),
    "irb1600_8_145": _Drawing(
        (0.4865, 0.150, 0.700, 0.0, 0.600, 0.065),
        _symmetric(180, (-90, 120), (-245, 65), 200, 115, 400),
        (180, 180, 200, 400, 400, 460),
        reach_m=1.45,
        mass_kg=250.0,
    ),
    "irb2600_12_165": _Drawing(
        (0.445, 0.150, 0.700, 0.115, 0.795, 0.085),
        _symmetric(180, (-155, 95), (-155, 75), 400, 120, 400),
        (175, 175, 175, 360, 360, 500),
        reach_m=1.65,
        mass_kg=272.0,
    ),
}

ABB_MODELS = tuple(_DRAWINGS)

_MASS_SHARES = np.array([27.0, 14.0, 15.0, 5.0, 1.5, 0.3]) / 98.0
"""Of an arm's mass in each link. ABB states the whole mass only. An estimate: a third stays in
the foot, the rest is shared along the arm as in arms of this build."""

_IRB140_COM_M = np.array(
    [
        [-0.03, 0.06, 0.0],
        [-0.18, 0.0, 0.0],
        [0.0, 0.0, 0.05],
        [0.0, -0.12, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.0, -0.01],
    ]
)


def abb(name: str) -> ArmKinematics:
    """Nominal kinematics of one of `ABB_MODELS`.

    In the zero pose the forearm points forward and so does the flange's z axis
    (tool0 = Ry(90 deg)).
    """
    drawing = _DRAWINGS[name]
    dh = _dh(*drawing.lengths_m)
    com_m = _IRB140_COM_M if name == "irb140" else _halfway_m(dh)
    return ArmKinematics(
        name=name,
        dh=dh,
        limits_rad=np.radians(drawing.limits_deg),
        max_speed_rad_s=np.radians(drawing.speed_deg_s),
        reach_m=drawing.reach_m,
        masses=LinkMasses(drawing.mass_kg * _MASS_SHARES, com_m, published=False),
        inverse_branches=spherical_wrist_branches,
    )


def _dh(d1: float, a1: float, a2: float, a3: float, d4: float, d6: float) -> FloatArray:
    return rows(
        (0.0, d1, a1, -_HALF),
        (-_HALF, 0.0, a2, 0.0),
        (0.0, 0.0, a3, -_HALF),
        (0.0, d4, 0.0, _HALF),
        (0.0, 0.0, 0.0, -_HALF),
        (np.pi, d6, 0.0, 0.0),
    )


def _halfway_m(dh: FloatArray) -> FloatArray:
    """(6, 3) in each link's own frame: half the way from its origin to the one before it."""
    _, d, a, alpha, _ = dh.T
    return -0.5 * np.column_stack([a, d * np.sin(alpha), d * np.cos(alpha)])
