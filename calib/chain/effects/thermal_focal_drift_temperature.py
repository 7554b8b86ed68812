"""Lens: its focal length follows the temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray, Views


def _act(values: FloatArray, state: ChainState) -> None:
    growth = 1.0 + values[0] * np.nan_to_num(state.views.temperature_c - values[1])
    state.column("alpha_px")[:] *= growth
    state.column("beta_px")[:] *= growth


def _candidates(views: Views) -> Sequence[Mapping[str, float]]:
    return ({"at_temperature_c": float(np.nanmean(views.temperature_c))},)


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
        Parameter("at_temperature_c", "degC", 25.0, -100.0, 200.0, role="setting"),
    ),
    act=_act,
    needs=("temperature_c",),
    varies=("temperature_c",),
    confounded_with=("thermal_mount_drift",),
    acts_along=tuple(("focal_length", along) for along in ("temperature", "time", "order")),
    remedy="Keep the camera at one temperature, or log it and let the twin correct.",
    candidates=_candidates,
)
