"""Lens: it or its stabiliser sags in its barrel as gravity turns."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    gravity = state.gravity_in_camera()
    state.column("u0_px")[:] += values[0] * gravity[:, 0]
    state.column("v0_px")[:] += values[0] * gravity[:, 1]


EFFECT = Effect(
    name="lens_sag",
    link="lens",
    physics="The lens or the image stabiliser sags, so the principal point follows gravity.",
    equation="(u0, v0) = (u0, v0) + px_per_g * (gravity direction along the sensor's axes)",
    source="Shortis, Robson, Beyer 1998 (principal point against camera roll)",
    parameters=(Parameter("px_per_g", "px/g", 1.5, -20.0, 20.0),),
    act=_act,
    confounded_with=("mount_flex",),
    acts_along=(("principal_point", "gravity"),),
    remedy="Switch the stabiliser off, clamp the lens, or work in one attitude.",
)
