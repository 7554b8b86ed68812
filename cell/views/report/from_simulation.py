"""The simulator's truth, as the report holds results against it."""

from __future__ import annotations

from calib.chain.effect import Effect
from calib.chain.model import CellModel, evaluate
from calib.chain.rigid import inverse
from calib.views import Views
from cell.views.report.data import Truth


def simulation_truth(model: CellModel, views: Views) -> Truth:
    """Where the simulated cell truly had its camera, up to the arm's own scatter in each frame.

    A board whose two ends look alike may have been named from the other end than the simulator's,
    so that poses in its frame cannot be compared; then only the scale factors are given.
    """
    state = evaluate(model, views)
    lopsided = (views.board.rows + views.board.cols) % 2 == 1
    return Truth(
        board_from_camera=inverse(state.camera_from_board) if lopsided else None,
        alpha_px=state.column("alpha_px"),
        beta_px=state.column("beta_px"),
        effects=tuple(_label(present.effect) for present in model.effects),
    )


def _label(effect: Effect) -> str:
    name = effect.name if effect.law is None else f"{effect.name} ({effect.law})"
    return name.replace("_", " ")
