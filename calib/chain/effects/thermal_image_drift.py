"""Sensor: it moves behind the lens as the camera warms."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.warming import START, TIME_CONSTANT, warming_candidates, warmth
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    warm = warmth(values[2], values[3], state.views)
    state.column("u0_px")[:] += values[0] * warm
    state.column("v0_px")[:] += values[1] * warm


EFFECT = Effect(
    name="thermal_image_drift",
    link="sensor",
    physics="The camera warms up and its sensor moves behind the lens, so the picture drifts.",
    equation="(u0, v0) = cold + (u_px, v_px) * (1 - exp(-(t - start) / tau))",
    source=(
        "image drift of a camera that heats itself: Handel 2007; sensor and lens expansion, Sci."
        " Rep. 9 (2019), camera warm-up"
    ),
    parameters=(
        Parameter("u_px", "px", 1.0, -50.0, 50.0),
        Parameter("v_px", "px", 1.0, -50.0, 50.0),
        TIME_CONSTANT,
        START,
    ),
    act=_act,
    needs=("t_s",),
    confounded_with=("thermal_mount_drift", "optics_step"),
    acts_along=tuple(("principal_point", along) for along in ("time", "order", "temperature")),
    remedy="Let the camera warm up before the run (three time constants).",
    candidates=warming_candidates,
)
