"""The bodies of the arms known by name."""

from __future__ import annotations

import numpy as np

from calib.bodies import abb, universal_robots
from calib.bodies.scene import Body
from calib.bodies.shape import Shape, capsule
from calib.chain.kinematics import ArmKinematics

_SHAPES = universal_robots.SHAPES | abb.SHAPES
_SOLD_AS = {"ur7e": "ur5e", "ur12e": "ur10e"}

LINK_NAMES = ("foot", "shoulder", "upper arm", "forearm", "wrist 1", "wrist 2", "wrist 3")

_APART = {
    "ur3": ((3, 5), (4, 6)),
    "ur3e": ((0, 2), (4, 6)),
    "ur5": ((4, 6),),
    "ur5e": ((3, 5), (4, 6)),
    "ur10": ((0, 2), (4, 6)),
    "ur10e": ((0, 2), (4, 6)),
    "ur16e": ((0, 2), (4, 6)),
    "ur20": ((0, 2), (3, 5), (4, 6)),
    "ur30": ((0, 2), (3, 5), (4, 6)),
    "irb140": ((0, 2), (1, 3), (2, 4), (3, 5), (4, 6)),
    "irb120": ((0, 2), (1, 3), (3, 5), (4, 6)),
    "irb1200_5_90": ((1, 3), (3, 5), (4, 6)),
    "irb1200_7_70": ((1, 3), (3, 5), (4, 6)),
    "irb1600_6_12": ((0, 2), (1, 3), (2, 4), (3, 5), (4, 6)),
    "irb1600_8_145": ((0, 2), (1, 3), (2, 4), (3, 5), (4, 6)),
    "irb2600_12_165": ((1, 3), (2, 4), (3, 5), (4, 6)),
}
"""Links that the joint limits alone keep apart: their meshes were held against each other (with
coal) on a grid of 10 to 15 degrees over the two joints between them, within the limits. Nothing
met, but for shoulder and forearm of ABB's arms in the one corner where joint 2 is past 104 degrees
with joint 3 near its upper limit; wrist 1 and wrist 3 of ABB's are one inside the other."""

_THICK = 0.15
"""Radius of an arm's links as a share of its upper arm or forearm, whichever is longer, where no
description states: the widest of the known arms has 0.14."""


def arm_bodies(arm: ArmKinematics) -> tuple[tuple[Body, ...], str]:
    """Foot and links of an arm, and where their shapes are from.

    Where nobody has measured this model, capsules from joint to joint stand in.
    """
    known_as = _SOLD_AS.get(arm.name, arm.name)
    measured = _SHAPES.get(known_as)
    if measured is None:
        return _from_joint_to_joint(arm), "capsules from joint to joint; no mesh of it is at hand"
    shapes = [tuple(_shape(row) for row in link) for link in measured]
    apart = _APART.get(known_as, ())
    bodies = tuple(
        Body(LINK_NAMES[i], i, shapes[i], clear_of=frozenset(b for a, b in apart if a == i))
        for i in range(len(shapes))
    )
    return bodies, "capsules and boxes around the collision meshes of a public description"


def _shape(row: tuple[float, ...]) -> Shape:
    """What a row of the tables means, by its length."""
    if len(row) == 7:
        return capsule(row[:3], row[3:6], row[6])
    if len(row) == 5:
        return _upright_cylinder(*row)
    corner, *next_to = np.array(row).reshape(4, 3)
    edges = np.array(next_to) - corner
    signs = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    return Shape(corner + signs @ edges)


def _upright_cylinder(x: float, y: float, low: float, high: float, radius: float) -> Shape:
    """The twelve-sided prism around it."""
    angles = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) * radius / np.cos(np.pi / 12)
    return Shape(np.array([[x + u, y + v, z] for u, v in ring for z in (low, high)]))


def _from_joint_to_joint(arm: ArmKinematics) -> tuple[Body, ...]:
    radius = _THICK * float(np.hypot(arm.dh[:, 1], arm.dh[:, 2])[1:].max())
    frames = arm.frames(np.zeros(len(arm.dh)))
    bodies = []
    for i in range(1, len(frames)):
        before = np.linalg.solve(frames[i], frames[i - 1, :, 3])[:3]
        bodies.append(Body(f"link {i}", i, (capsule(before, np.zeros(3), radius),)))
    return tuple(bodies)
