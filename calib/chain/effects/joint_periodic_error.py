"""Arm: a joint's encoder or gear errs once (or a few times) a turn."""

from __future__ import annotations

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    cycles = values[12]
    phase = cycles * state.views.joints_rad
    state.joints_rad = state.joints_rad + values[0:6] * np.sin(phase) + values[6:12] * np.cos(phase)


EFFECT = Effect(
    name="joint_periodic_error",
    link="arm",
    physics="A joint's encoder or gear errs periodically as it turns.",
    equation="q_true = q_logged + sin_rad * sin(n q) + cos_rad * cos(n q), n cycles a turn",
    source="encoder eccentricity: n = 1; strain-wave gear: n = 2 times its ratio (maker's data)",
    parameters=(
        *(Parameter(f"sin_rad_{j}", "rad", 2e-4, -0.01, 0.01) for j in range(1, 7)),
        *(Parameter(f"cos_rad_{j}", "rad", 2e-4, -0.01, 0.01) for j in range(1, 7)),
        Parameter("cycles_per_turn", "1", 1.0, 1.0, 400.0, role="setting"),
    ),
    act=_act,
    needs=("joints_rad",),
    confounded_with=("joint_compliance", "joint_zero_offset", "link_geometry"),
    remedy="Have the joint's encoder checked, or let the twin correct the flange pose.",
    candidates=lambda views: [{"cycles_per_turn": float(n)} for n in (1, 2, 3, 4)],
)
