"""Lens: two radial terms are not enough."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.column("k3")[:] += values[0]


EFFECT = Effect(
    name="higher_order_radial",
    link="lens",
    physics="The lens bends straight lines more, near the edge, than two radial terms can say.",
    equation="x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6)",
    source="Brown 1971, Close-range camera calibration",
    parameters=(Parameter("k3", "1", 0.3, -50.0, 50.0),),
    act=_act,
    seen_without_robot=True,
    remedy="Use a calibration with k3.",
)
