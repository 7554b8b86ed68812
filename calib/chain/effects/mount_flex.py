"""Mount: the bracket bends as gravity turns around it."""

from __future__ import annotations

import numpy as np

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.walk import DOWN_IN_BASE, Walk
from calib.views import FloatArray

_AXIS = np.array([0.0, 0.0, 1.0])


def _act(values: FloatArray, walk: Walk) -> None:
    gravity = np.einsum("nji,j->ni", walk.base_from_flange[:, :3, :3], DOWN_IN_BASE)
    bend = values[0] * np.cross(_AXIS, gravity)
    walk.flange_from_mounted = rigid.compose(bend, np.zeros_like(bend)) @ walk.flange_from_mounted


EFFECT = Effect(
    name="mount_flex",
    link="mount",
    physics="The bracket between flange and camera bends under the camera's weight.",
    equation="rotation at the flange = rad_per_g * (flange z axis x gravity direction)",
    source="cantilever with a tip mass: slope proportional to the transverse load (Roark, ch. 8)",
    parameters=(Parameter("rad_per_g", "rad/g", 5e-4, -0.02, 0.02),),
    act=_act,
    confounded_with=("lens_sag", "joint_compliance"),
    acts_along=(("mounted_pose", "gravity"),),
    remedy="Stiffen the bracket, or let the twin correct flange_from_camera for gravity.",
)
