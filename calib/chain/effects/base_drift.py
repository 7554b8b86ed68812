"""Arm: its base creeps against what stands in the cell."""

from __future__ import annotations

from calib.chain import rigid
from calib.chain.effect import Effect
from calib.chain.state import ChainState
from calib.chain.steps import SIX
from calib.chain.warming import START, TIME_CONSTANT, warming_candidates, warmth
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    drift = warmth(values[6], values[7], state.views)[:, None] * values[:6]
    state.base_from_flange = rigid.product(rigid.from_vector(drift), state.base_from_flange)


EFFECT = Effect(
    name="base_drift",
    link="arm",
    physics="The arm's base creeps against what stands in the cell, as it warms or as it settles.",
    equation="base_from_flange = exp(drift * (1 - exp(-(t - start) / tau))) * logged",
    source=(
        "first-order warm-up of the arm's foot and column, as in Heisel, Richter, Wurst 1997"
        " (thermal behaviour of industrial robots)"
    ),
    parameters=(*SIX, TIME_CONSTANT, START),
    act=_act,
    needs=("t_s",),
    confounded_with=("board_slip", "thermal_mount_drift"),
    acts_along=(("fixed_pose", "time"), ("fixed_pose", "order"), ("fixed_pose", "temperature")),
    remedy="Let the arm warm up before the run, and check its feet and what the board stands on.",
    candidates=warming_candidates,
)
