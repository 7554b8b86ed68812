"""Mount: the bracket grows with its temperature."""

from __future__ import annotations

import numpy as np

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.warming import AT_TEMPERATURE, temperature_candidates, temperature_rise
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    growth = temperature_rise(values[3], state.views)[:, None] * values[:3]
    grown = rigid.compose(np.zeros_like(growth), growth)
    state.flange_from_mounted = grown @ state.flange_from_mounted


EFFECT = Effect(
    name="thermal_mount_drift",
    law="temperature",
    link="mount",
    physics="The bracket grows in one direction with its temperature.",
    equation=(
        "flange_from_mounted is moved by (x, y, z)_m_per_K * (temperature_c - at_temperature_c)"
        " along the flange's axes"
    ),
    source=(
        "linear expansion of a bracket of 0.1 to 0.3 m: steel 12e-6, aluminium 23e-6, printed"
        " plastic 90e-6 per K"
    ),
    parameters=(
        *(Parameter(f"{axis}_m_per_K", "m/K", 1e-5, -2e-3, 2e-3) for axis in "xyz"),
        AT_TEMPERATURE,
    ),
    act=_act,
    needs=("temperature_c",),
    varies=("temperature_c",),
    confounded_with=("mount_slip", "thermal_focal_drift"),
    acts_along=tuple(("mounted_pose", along) for along in ("temperature", "time", "order")),
    remedy="Use a bracket of steel, keep its temperature, or log it and let the twin correct.",
    candidates=temperature_candidates,
)
