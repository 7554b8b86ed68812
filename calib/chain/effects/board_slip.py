"""Board: it was knocked during the run."""

from __future__ import annotations

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.steps import SIX, after, step_candidates
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    moved = after(values[6], state.views)
    state.base_from_fixed = state.base_from_fixed @ rigid.from_vector(moved * values[:6])


EFFECT = Effect(
    name="board_slip",
    link="board",
    physics="What stands fixed in the cell (the board) moved once, between two frames.",
    equation="base_from_fixed = before * exp(slip) from frame `at_frame` on",
    source="change-point model, as for datum shifts in deformation surveys (Caspary 2000)",
    parameters=(*SIX, Parameter("at_frame", "frame", 0.0, 0.0, 1e9, role="setting")),
    act=_act,
    confounded_with=("mount_slip",),
    remedy="Fix the board and repeat the run; frames before and after are of two cells.",
    candidates=step_candidates,
)
