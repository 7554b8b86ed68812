"""Mount: it drifts as the camera warms it."""

from __future__ import annotations

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.steps import SIX
from calib.chain.warming import START, TIME_CONSTANT, warming_candidates, warmth
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    drift = warmth(values[6], values[7], state.views)[:, None] * values[:6]
    state.flange_from_mounted = state.flange_from_mounted @ rigid.from_vector(drift)


EFFECT = Effect(
    name="thermal_mount_drift",
    link="mount",
    physics="The bracket warms up and carries the camera slowly away.",
    equation="flange_from_mounted = cold * exp(drift * (1 - exp(-(t - start) / tau)))",
    source="first-order warm-up, as for camera mounts in Handel 2007 and Podbreznik 2011",
    parameters=(
        *(Parameter(p.name, p.unit, p.typical, p.low, p.high) for p in SIX),
        TIME_CONSTANT,
        START,
    ),
    act=_act,
    needs=("t_s",),
    confounded_with=("mount_slip", "board_slip", "thermal_focal_drift"),
    acts_along=(
        ("mounted_pose", "time"),
        ("mounted_pose", "order"),
        ("mounted_pose", "temperature"),
    ),
    remedy="Let camera and robot warm up before the run (three time constants).",
    candidates=warming_candidates,
)
