"""Lens: its distortion changes with the focus."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.column("k1")[:] += values[0] / state.focused_m


EFFECT = Effect(
    name="distance_dependent_distortion",
    link="lens",
    physics="The lens's distortion changes as it focuses nearer.",
    equation="k1(d) = k1 + slope_m / d",
    source="Brown 1971 (Magill's formula); Fraser, Shortis 1992",
    parameters=(Parameter("slope_m", "m", 5e-3, -1.0, 1.0),),
    act=_act,
    seen_without_robot=True,
    confounded_with=("entrance_pupil_shift", "protective_window"),
    acts_along=(("radial_distortion", "distance"),),
    remedy="Use one calibration for each working distance, or the twin.",
)
