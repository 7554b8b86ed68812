"""Mount: the bracket has slack, and falls to the other side as gravity turns around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import DOWN_IN_BASE, ChainState
from calib.chain.steps import SIX
from calib.views import FloatArray, Views

_ALIKE_RAD = 1e-3
_SHARP_RAD = 1e-9


def _act(values: FloatArray, state: ChainState) -> None:
    down = np.einsum("nji,j->ni", state.base_from_flange[:, :3, :3], DOWN_IN_BASE)
    along = down[:, :2] @ [np.cos(values[6]), np.sin(values[6])]
    past_tipping = np.arcsin(along / np.maximum(np.linalg.norm(down[:, :2], axis=1), 1e-12))
    side = np.clip(past_tipping / max(values[7], _SHARP_RAD), -1.0, 1.0)[:, None]
    play = rigid.from_vector(side * values[:6])
    state.flange_from_mounted = state.flange_from_mounted @ play


def _candidates(views: Views) -> Sequence[Mapping[str, float]]:
    """Every way to part the frames in two sides: from one frame's tipping half way to the next."""
    down = np.einsum("nji,j->ni", views.base_from_flange[views.has_pose, :3, :3], DOWN_IN_BASE)
    tips = np.sort((np.arctan2(down[:, 1], down[:, 0]) + 0.5 * np.pi) % np.pi)
    gaps = np.diff(tips, append=tips[:1] + np.pi)
    return [
        {"towards_rad": float((start + 0.5 * gap) % np.pi), "unseen_rad": float(0.5 * gap)}
        for start, gap in zip(tips, gaps, strict=True)
        if gap > _ALIKE_RAD
    ]


EFFECT = Effect(
    name="mount_play",
    link="mount",
    physics=(
        "The bracket on the flange has slack: it lies against one stop or the other, by the side to"
        " which it is tilted."
    ),
    equation=(
        "flange_from_mounted = middle * exp(side * play), side the sign of gravity along the"
        " flange's axis (cos towards_rad, sin towards_rad, 0), in proportion within unseen_rad of"
        " where it tips, where no frame was"
    ),
    source=(
        "clearance of a bolted or pinned joint that rests on the side of its load (Ting, Zhu,"
        " Watkins 2000, joint clearance and positional error); sizes of screw clearances, ISO 273"
    ),
    parameters=(
        *SIX,
        Parameter("towards_rad", "rad", 0.0, 0.0, np.pi, role="setting"),
        Parameter("unseen_rad", "rad", 0.0, 0.0, np.pi, role="setting"),
    ),
    act=_act,
    confounded_with=("mount_flex", "lens_sag"),
    acts_along=(("mounted_pose", "gravity"),),
    remedy="Tighten the bracket's screws, pin it, or work in attitudes of one side only.",
    candidates=_candidates,
)
