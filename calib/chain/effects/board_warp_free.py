"""Board: it is not flat in some smooth way that a bend and a twist do not describe."""

from __future__ import annotations

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray

_ORDER = 5
_WAVES = tuple((i, j) for i in range(_ORDER) for j in range(_ORDER) if i + j > 1)
"""Half waves along x and y; a tilt is the board's pose."""


def _act(values: FloatArray, state: ChainState) -> None:
    board = state.views.board
    right, bottom = board.extent_m
    x, y = state.points_m[:, 0] / right, state.points_m[:, 1] / bottom
    along_x = np.cos(np.pi * np.arange(_ORDER)[:, None] * x)
    along_y = np.cos(np.pi * np.arange(_ORDER)[:, None] * y)
    for amount, (i, j) in zip(values, _WAVES, strict=True):
        if amount:
            state.points_m[:, 2] += amount * along_x[i] * along_y[j]


EFFECT = Effect(
    name="board_warp",
    law="free",
    link="board",
    physics="The board is not flat: it has bumps and waves, as paper and foil on a panel have.",
    equation="z = sum of wave_i_j_m cos(pi i x) cos(pi j y), i and j up to 4, x and y from 0 to 1",
    source=(
        "smooth surface in cosines whose usual size falls off with the square of their order, as a"
        " bent plate's does (Timoshenko, Woinowsky-Krieger 1959, sec. 30)"
    ),
    parameters=tuple(
        Parameter(
            f"wave_{i}_{j}_m",
            "m",
            3e-4 / (i * i + j * j),
            -0.02,
            0.02,
            prior_sigma=4e-3 / (i * i + j * j),
        )
        for i, j in _WAVES
    ),
    act=_act,
    seen_without_robot=True,
    confounded_with=("sensor_tilt", "decentering", "higher_order_radial"),
    remedy="Print on something stiff and flat, or let the twin carry the board's shape.",
    separable=False,
)
