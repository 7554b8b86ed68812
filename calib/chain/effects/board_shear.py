"""Board: its axes are not square to each other, or not of one scale."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.points_m[:, 0] += values[0] * state.points_m[:, 1]
    state.points_m[:, 1] *= 1.0 + values[1]


EFFECT = Effect(
    name="board_shear",
    link="board",
    physics="The print is skewed: rows and columns are not square, or differ in scale.",
    equation="x = x + shear * y; y = (1 + aspect) * y",
    source="affine printer error",
    parameters=(
        Parameter("shear", "1", 1e-3, -0.02, 0.02),
        Parameter("aspect", "1", 1e-3, -0.02, 0.02),
    ),
    act=_act,
    seen_without_robot=True,
    remedy="Print the board on another machine, or let the twin carry its shape.",
)
