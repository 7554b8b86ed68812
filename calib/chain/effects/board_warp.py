"""Board: it is bent or twisted."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    board = state.views.board
    right, bottom = board.extent_m
    x = state.points_m[:, 0] / right * 2.0 - 1.0
    y = state.points_m[:, 1] / bottom * 2.0 - 1.0
    height = values[0] * (x * x - 1.0) + values[1] * (y * y - 1.0) + values[2] * x * y
    state.points_m[:, 2] += height


EFFECT = Effect(
    name="board_warp",
    link="board",
    physics="The board is not flat: it is bent like a sheet or twisted.",
    equation="z = bend_x_m (x^2 - 1) + bend_y_m (y^2 - 1) + twist_m x y, x and y from -1 to 1",
    source="second-order plate shape, as in mrcal's calibration-object model",
    parameters=(
        Parameter("bend_x_m", "m", 3e-4, -0.02, 0.02),
        Parameter("bend_y_m", "m", 3e-4, -0.02, 0.02),
        Parameter("twist_m", "m", 3e-4, -0.02, 0.02),
    ),
    act=_act,
    seen_without_robot=True,
    remedy="Glue the board to something stiff and flat, or let the twin carry its shape.",
)
