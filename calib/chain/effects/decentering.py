"""Lens: its elements are not on one axis."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.column("p1")[:] += values[0]
    state.column("p2")[:] += values[1]


EFFECT = Effect(
    name="decentering",
    link="lens",
    physics="The lens's elements are not centred on one axis, which bends straight lines sideways.",
    equation="dx = 2 p1 x y + p2 (r^2 + 2 x^2); dy = p1 (r^2 + 2 y^2) + 2 p2 x y",
    source="Brown 1966, Decentering distortion of lenses",
    parameters=(
        Parameter("p1", "1", 5e-4, -0.05, 0.05),
        Parameter("p2", "1", 5e-4, -0.05, 0.05),
    ),
    act=_act,
    seen_without_robot=True,
    confounded_with=("sensor_tilt",),
    remedy="Use a calibration with p1 and p2 (the twin and every export have them).",
)
