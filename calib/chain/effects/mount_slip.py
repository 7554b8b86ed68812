"""Mount: the camera was knocked or its bracket slipped during the run."""

from __future__ import annotations

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.steps import SIX, after, step_candidates
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    moved = after(values[6], state.views)
    state.flange_from_mounted = state.flange_from_mounted @ rigid.from_vector(moved * values[:6])


EFFECT = Effect(
    name="mount_slip",
    link="mount",
    physics="What is mounted on the flange moved once, between two frames, and stayed there.",
    equation="flange_from_mounted = before * exp(slip) from frame `at_frame` on",
    source="change-point model, as for datum shifts in deformation surveys (Caspary 2000)",
    parameters=(*SIX, Parameter("at_frame", "frame", 0.0, 0.0, 1e9, role="setting")),
    act=_act,
    confounded_with=("board_slip", "thermal_mount_drift"),
    remedy="Tighten the bracket and repeat the run; frames before and after are of two cells.",
    candidates=step_candidates,
)
