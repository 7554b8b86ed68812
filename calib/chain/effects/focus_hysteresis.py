"""Lens: the focus ends elsewhere when it comes from near than when it comes from far."""

from __future__ import annotations

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.walk import Walk
from calib.views import FloatArray


def _act(values: FloatArray, walk: Walk) -> None:
    order = np.argsort(walk.views.frame, kind="stable")
    came_from = np.empty(len(order))
    distance_m = walk.distance_m[order]
    came_from[order] = np.sign(np.diff(distance_m, prepend=distance_m[:1]))
    growth = 1.0 + values[0] * came_from
    walk.column("alpha_px")[:] *= growth
    walk.column("beta_px")[:] *= growth


EFFECT = Effect(
    name="focus_hysteresis",
    link="lens",
    physics="The focus drive has play: it stops elsewhere when it comes from near than from far.",
    equation="alpha = alpha0 * (1 + relative * sign(distance - distance of the frame before))",
    source="play of a focus drive; size from autofocus repeatability of machine-vision lenses",
    parameters=(Parameter("relative", "1", 3e-4, -0.02, 0.02),),
    act=_act,
    confounded_with=("focus_breathing",),
    remedy="Always focus from the same side (drive past the target and come back), or lock it.",
)
