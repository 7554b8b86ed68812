"""Lens: the focal length follows the focus as a thin lens's image distance does."""

from __future__ import annotations

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    distance_m = np.maximum(state.focused_m, 1e-3)
    growth = distance_m / (distance_m - np.minimum(values[0], 0.9 * distance_m))
    state.column("alpha_px")[:] *= growth
    state.column("beta_px")[:] *= growth


EFFECT = Effect(
    name="focus_breathing",
    law="thin_lens",
    link="lens",
    physics="The lens moves out to focus near things, so its focal length grows as they near.",
    equation="alpha = alpha_inf * d / (d - f), d the distance the lens is focused at",
    source="Gaussian lens equation, 1/f = 1/d + 1/b (Born & Wolf, section 4.4)",
    parameters=(Parameter("f_m", "m", 0.015, -0.2, 0.2),),
    act=_act,
    confounded_with=("thermal_focal_drift",),
    acts_along=(("focal_length", "distance"),),
    remedy="Lock the focus, or use the focal length of each distance (the twin has it).",
)
