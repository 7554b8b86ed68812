"""Arm: lengths and twists of the links differ from the nominal ones."""

from __future__ import annotations

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray

_THETA, _D, _A, _ALPHA = range(4)
_LENGTHS = (
    *(("d4_m", 3, _D), ("d5_m", 4, _D)),
    *((f"a{j}_m", j - 1, _A) for j in (2, 3, 1, 4, 5)),
)
_TWISTS = tuple((f"twist_rad_{j}", j - 1, _ALPHA) for j in range(1, 6))
_ENTRIES = _LENGTHS + _TWISTS


def _act(values: FloatArray, state: ChainState) -> None:
    offset = np.zeros((6, 5)) if state.dh_offset is None else state.dh_offset
    for value, (_, joint, column) in zip(values, _ENTRIES, strict=True):
        offset[joint, column] += value
    state.dh_offset = offset


EFFECT = Effect(
    name="link_geometry",
    link="arm",
    physics="The arm's links are longer, shorter or more twisted than its drawing says.",
    equation="Denavit-Hartenberg rows: d4, d5, a1..a5 and the twists alpha1..alpha5 are changed",
    source="Denavit, Hartenberg 1955; sizes from makers' factory calibrations",
    parameters=(
        *(Parameter(name, "m", 3e-4, -0.02, 0.02) for name, _, _ in _LENGTHS),
        *(Parameter(name, "rad", 5e-4, -0.05, 0.05) for name, _, _ in _TWISTS),
    ),
    act=_act,
    needs=("joints_rad",),
    confounded_with=("joint_zero_offset", "board_scale"),
    remedy="Read the arm's factory-calibrated kinematics from its controller and use them.",
)
