"""Lens: the focus ends elsewhere when it comes from near than when it comes from far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray, Views

_FIRST_FRAME, _FIRST_CAME_FROM_M = 1, 2


def _came_from_m(state: ChainState) -> FloatArray:
    """(N,) distance of the board where the arm came from; the frame before where not logged."""
    order = np.argsort(state.views.frame, kind="stable")
    before = np.empty(len(order))
    before[order] = np.concatenate([state.focused_m[order][:1], state.focused_m[order][:-1]])
    arm, views = state.arm, state.views
    if arm is None or not state.in_hand:
        return before
    flange = state.once("approach_flange", lambda: arm.forward(views.approach_joints_rad))
    camera = rigid.product(flange, state.flange_from_mounted)
    camera_from_board = rigid.product(rigid.inverse(camera), state.base_from_fixed)
    centre = state.points_m.mean(axis=0)
    approach = camera_from_board[:, 2, :3] @ centre + camera_from_board[:, 2, 3]
    return np.where(np.isfinite(approach), approach, before)


def _act(values: FloatArray, state: ChainState) -> None:
    first = state.views.frame == values[_FIRST_FRAME]
    before = np.where(first, values[_FIRST_CAME_FROM_M], _came_from_m(state))
    growth = 1.0 + values[0] * np.sign(state.focused_m - before)
    state.column("alpha_px")[:] *= growth
    state.column("beta_px")[:] *= growth


def _candidates(views: Views) -> Sequence[Mapping[str, float]]:
    """The first frame's focus came from nearer, or from farther: nobody saw it before."""
    first = float(views.frame.min())
    return [{"first_frame": first, "first_came_from_m": side} for side in (0.0, 1e3)]


EFFECT = Effect(
    name="focus_hysteresis",
    link="lens",
    physics="The focus drive has play: it stops elsewhere when it comes from near than from far.",
    equation="alpha = alpha0 * (1 + relative * sign(distance - distance it came from))",
    source="play of a focus drive; size from autofocus repeatability of machine-vision lenses",
    parameters=(
        Parameter("relative", "1", 3e-4, -0.02, 0.02),
        Parameter("first_frame", "1", -1.0, -1.0, 1e12, role="setting"),
        Parameter("first_came_from_m", "m", 0.0, 0.0, 1e3, role="setting"),
    ),
    act=_act,
    candidates=_candidates,
    confounded_with=("focus_breathing",),
    remedy="Always focus from the same side (drive past the target and come back), or lock it.",
)
