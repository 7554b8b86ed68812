"""Lens: the focal length follows the focus by the paper's own law."""

from __future__ import annotations

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    near = 1.0 / np.square(state.focused_m)
    ratio = state.column("beta_px") / state.column("alpha_px")
    state.column("alpha_px")[:] -= values[0] * near
    state.column("beta_px")[:] -= values[0] * near * ratio


EFFECT = Effect(
    name="focus_breathing",
    law="inverse_square",
    link="lens",
    physics="The lens moves to focus, so its focal length depends on the distance of the board.",
    equation="alpha = alpha0 - k / d^2, d the distance the lens is focused at",
    source="Ricolfe-Viala, The influence of the focus in the camera calibration process, Eq. 25",
    parameters=(Parameter("k_px_m2", "px m^2", 10.0, -2000.0, 2000.0),),
    act=_act,
    confounded_with=("thermal_focal_drift",),
    acts_along=(("focal_length", "distance"),),
    remedy="Lock the focus, or use the focal length of each distance (the twin has it).",
)
