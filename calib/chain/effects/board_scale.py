"""Board: it was printed too large or too small."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.points_m *= 1.0 + values[0]


EFFECT = Effect(
    name="board_scale",
    link="board",
    physics="The board's squares are not as large as the file says.",
    equation="true corner = (1 + relative) * nominal corner",
    source="printer scale error; measured against the robot's own lengths",
    parameters=(Parameter("relative", "1", 2e-3, -0.5, 0.5),),
    act=_act,
    confounded_with=("link_geometry",),
    remedy="Measure the board with a calliper over many squares and correct square_m.",
)
