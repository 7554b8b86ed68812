"""Arm: what it stands on tilts under the moment of its weight."""

from __future__ import annotations

import numpy as np

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    arm, views = state.arm, state.views
    if arm is None:
        return
    moment_Nm = state.once(
        "base_moment_Nm", lambda: arm.base_moment(views.joints_rad, views.payload_kg or 0.0)
    )
    turn = np.nan_to_num(moment_Nm) * np.array([values[0], values[0] + values[1], 0.0])
    tilted = rigid.compose(turn, np.zeros_like(turn))
    state.base_from_flange = rigid.product(tilted, state.base_from_flange)


EFFECT = Effect(
    name="base_compliance",
    link="arm",
    physics="The pedestal or table under the arm tilts with the moment of the arm's weight.",
    equation=(
        "base turns by (rad_per_Nm * Mx, (rad_per_Nm + rad_per_Nm_y_more) * My), M the moment of"
        " links and payload about the base's origin"
    ),
    source=(
        "Klimchik, Pashkevich, Chablat 2013 (elastic base as a further virtual joint); stiffness of"
        " steel pedestals and bolted tables 1e5 to 1e7 Nm/rad"
    ),
    parameters=(
        Parameter("rad_per_Nm", "rad/Nm", 5e-6, -1e-4, 1e-4),
        Parameter("rad_per_Nm_y_more", "rad/Nm", 3e-6, -1e-4, 1e-4),
    ),
    act=_act,
    needs=("joints_rad",),
    confounded_with=("joint_compliance", "link_geometry"),
    remedy="Bolt the base down or stiffen the pedestal, or let the twin correct the flange pose.",
)
