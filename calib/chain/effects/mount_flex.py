"""Mount: the bracket bends as gravity turns around it.

A camera out along the flange's axis leans by `rad_per_g`; one that sits aside has a lever aside,
and a bracket that is not symmetric turns about the direction of gravity itself.
"""

from __future__ import annotations

import numpy as np

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import DOWN_IN_BASE, ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    gravity = np.einsum("nji,j->ni", state.base_from_flange[:, :3, :3], DOWN_IN_BASE)
    lever = values[[1, 2, 0]]
    bend = np.cross(lever, gravity) + values[3] * gravity
    state.flange_from_mounted = rigid.compose(bend, np.zeros_like(bend)) @ state.flange_from_mounted


EFFECT = Effect(
    name="mount_flex",
    link="mount",
    physics="The bracket between flange and camera bends under the camera's weight.",
    equation="rotation at the flange = lever x gravity + turn * gravity; lever = rad_per_g along z",
    source="cantilever with a tip mass: slope proportional to the transverse load (Roark, ch. 8)",
    parameters=tuple(
        Parameter(f"rad_per_g{part}", "rad/g", 5e-4, -0.02, 0.02)
        for part in ("", "_lever_x", "_lever_y", "_turn")
    ),
    act=_act,
    confounded_with=("lens_sag", "joint_compliance"),
    acts_along=(("mounted_pose", "gravity"),),
    remedy="Stiffen the bracket, or let the twin correct flange_from_camera for gravity.",
)
