"""Lens: rays at the edge of the field enter elsewhere than those at its centre."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.column("pupil_m_rad2")[:] += values[0]


EFFECT = Effect(
    name="entrance_pupil_shift",
    link="lens",
    physics="The lens has no single centre: rays from the field's edge enter at another depth.",
    equation="Z' = Z + pupil_m_rad2 * theta^2",
    source="Kumar, Ahuja 2015, On the equivalence of moving entrance pupil and radial distortion",
    parameters=(Parameter("pupil_m_rad2", "m/rad^2", 3e-3, -0.03, 0.03),),
    act=_act,
    seen_without_robot=True,
    confounded_with=("protective_window", "distance_dependent_distortion"),
    remedy="Work at one distance, or use a non-central camera model (the twin has it).",
)
