"""Lens: a pane of glass stands in front of it."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.column("window_m")[:] += values[0]


EFFECT = Effect(
    name="protective_window",
    link="lens",
    physics="A flat window in front of the lens shifts oblique rays.",
    equation="Z' = Z - t (1 - cos(theta) / sqrt(n^2 - sin^2(theta))), n = 1.5",
    source="Snell's law for a plane-parallel plate (Born & Wolf, section 4.7)",
    parameters=(Parameter("thickness_m", "m", 3e-3, 0.0, 0.02),),
    act=_act,
    seen_without_robot=True,
    confounded_with=("entrance_pupil_shift", "distance_dependent_distortion"),
    remedy="Calibrate with the window that will be there at work; or take it off and compare.",
)
