"""Arm: the joints' zero marks are off."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.joints_rad = state.joints_rad + values


EFFECT = Effect(
    name="joint_zero_offset",
    link="arm",
    physics="One or more joints read an angle that is off by a constant.",
    equation="q_true = q_logged + offset_rad (first and last joint: absorbed by board and mount)",
    source="Mooring, Roth, Driels 1991, ch. 3; irreducible set as in Klimchik et al. 2013",
    parameters=tuple(
        Parameter(f"offset_rad_{j}", "rad", 5e-4, -0.05, 0.05, identifiable=1 < j < 6)
        for j in range(1, 7)
    ),
    act=_act,
    needs=("joints_rad",),
    confounded_with=("link_geometry",),
    remedy="Have the arm's zero marks calibrated, or load its factory calibration into the log.",
)
