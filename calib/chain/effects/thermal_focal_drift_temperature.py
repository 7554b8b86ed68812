"""Lens: its focal length follows the temperature."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.warming import AT_TEMPERATURE, temperature_candidates, temperature_rise
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    growth = 1.0 + values[0] * temperature_rise(values[1], state.views)
    state.column("alpha_px")[:] *= growth
    state.column("beta_px")[:] *= growth


EFFECT = Effect(
    name="thermal_focal_drift",
    law="temperature",
    link="lens",
    physics="The lens's focal length follows its temperature.",
    equation="alpha = alpha0 * (1 + relative_per_K * (temperature_c - at_temperature_c))",
    source=(
        "Smith, Cope 2010 (effects of temperature variation on single-lens-reflex camera"
        " calibration); expansion of glass, mount and sensor as in Sci. Rep. 9 (2019)"
    ),
    parameters=(
        Parameter("relative_per_K", "1/K", 3e-5, -5e-3, 5e-3),
        AT_TEMPERATURE,
    ),
    act=_act,
    needs=("temperature_c",),
    varies=("temperature_c",),
    confounded_with=("thermal_mount_drift",),
    acts_along=tuple(("focal_length", along) for along in ("temperature", "time", "order")),
    remedy="Keep the camera at one temperature, or log it and let the twin correct.",
    candidates=temperature_candidates,
)
