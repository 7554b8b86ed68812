"""Arm: play in the gears, taken up on the side the joint came from."""

from __future__ import annotations

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    travel = state.views.joints_rad - state.views.approach_joints_rad
    state.joints_rad = state.joints_rad + values * np.sign(np.nan_to_num(travel))


EFFECT = Effect(
    name="joint_backlash",
    link="arm",
    physics="A joint stops short on the side it comes from: its gears have play.",
    equation="q_true = q_logged + play_rad * sign(q_logged - q_approach)",
    source="ISO 9283 (multi-directional pose accuracy variation); Slamani, Nubiola, Bonev 2012",
    parameters=tuple(Parameter(f"play_rad_{j}", "rad", 1e-4, -0.01, 0.01) for j in range(1, 7)),
    act=_act,
    needs=("joints_rad", "approach_joints_rad"),
    confounded_with=("joint_periodic_error",),
    remedy="Approach every pose from the same side, or have the gear inspected.",
)
