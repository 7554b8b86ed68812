"""Board: it grows as it warms."""

from __future__ import annotations

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.warming import START, TIME_CONSTANT, warming_candidates, warmth
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    size = 1.0 + values[0] * warmth(values[1], values[2], state.views)[:, None]
    camera_m, board = state.base_from_camera[:, :3, 3], state.base_from_board.copy()
    middle = board[:, :3, :3] @ state.points_m.mean(axis=0)
    # to the camera a board that has grown is one that stands nearer by the same share; only a lens
    # that focuses on it would distinguish them, by less than a thousandth of a pixel
    away = board[:, :3, 3] + middle - camera_m
    board[:, :3, 3] = camera_m + away / size - middle
    if state.in_hand:
        state.base_from_fixed = board
    else:
        state.flange_from_mounted = rigid.product(rigid.inverse(state.base_from_flange), board)


EFFECT = Effect(
    name="thermal_board_growth",
    link="board",
    physics="The board warms up and grows about its middle.",
    equation=(
        "true corner = middle + (corner - middle) * (1 + relative * (1 - exp(-(t - start) / tau)))"
    ),
    source="linear expansion (aluminium 23e-6 / K, acrylic 70e-6 / K), first-order warm-up",
    parameters=(Parameter("relative", "1", 3e-4, -0.05, 0.05), TIME_CONSTANT, START),
    act=_act,
    needs=("t_s",),
    confounded_with=("thermal_focal_drift", "thermal_mount_drift"),
    remedy="Let the board come to the room's temperature, and keep lamps from heating it.",
    candidates=warming_candidates,
)
