"""Lens: its focal length drifts as it warms."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.warming import START, TIME_CONSTANT, warming_candidates, warmth
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    growth = 1.0 + values[0] * warmth(values[1], values[2], state.views)
    state.column("alpha_px")[:] *= growth
    state.column("beta_px")[:] *= growth


EFFECT = Effect(
    name="thermal_focal_drift",
    link="lens",
    physics="The lens warms up and its focal length drifts with time.",
    equation="alpha = alpha_cold * (1 + relative * (1 - exp(-(t - start) / tau)))",
    source="Handel 2007; lens and sensor expansion as in Sci. Rep. 9 (2019), camera warm-up",
    parameters=(Parameter("relative", "1", 5e-4, -0.05, 0.05), TIME_CONSTANT, START),
    act=_act,
    needs=("t_s",),
    confounded_with=("thermal_mount_drift",),
    acts_along=(
        ("focal_length", "time"),
        ("focal_length", "order"),
        ("focal_length", "temperature"),
    ),
    remedy="Let the camera warm up before the run (three time constants).",
    candidates=warming_candidates,
)
