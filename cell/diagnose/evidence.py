"""The arrays behind a diagnosis, for the report's pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.chain import rigid
from calib.chain.model import CellModel, predict, walk
from calib.discovery.diagnosis import Diagnosis
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views
from cell.report.data import Evidence


def evidence_of(found: Diagnosis, rows: NDArray[np.intp], frames: int) -> Evidence:
    """Residuals at the robot's poses and camera pose errors, before and after.

    Parameters
    ----------
    found:
        The diagnosis.
    rows, frames:
        Where its frames stand among all frames of the report, and how many these are.
    """
    views = found.views

    def spread(value: FloatArray) -> FloatArray:
        out = np.full((frames, *value.shape[1:]), np.nan)
        out[rows] = value
        return out

    before = spread(_camera_error(found.plain, views))
    after = spread(_camera_error(found.twin, views))
    return Evidence(
        before_px=spread(views.corners_px - predict(found.plain.model, views)),
        after_px=spread(views.corners_px - predict(found.twin.model, views)),
        shift_before_m=before[:, :3],
        turn_before_rad=before[:, 3:],
        shift_after_m=after[:, :3],
        turn_after_rad=after[:, 3:],
        board_offset_m=_board_offset(found.twin.model, views),
    )


def _camera_error(fit: JointFit, views: Views) -> FloatArray:
    """(N, 6) what must be added to the camera's pose in its own frame."""
    state = walk(fit.model, views)
    if state.in_hand:
        to_camera = rigid.adjoint(rigid.inverse(state.flange_from_mounted))
        return np.asarray(np.einsum("nij,nj->ni", to_camera, fit.flange_error))
    to_camera = -rigid.adjoint(rigid.inverse(state.base_from_fixed) @ state.base_from_flange)
    return np.asarray(np.einsum("nij,nj->ni", to_camera, fit.flange_error))


def _board_offset(model: CellModel, views: Views) -> FloatArray:
    """(M, 3) where the corners are, less where the drawing has them."""
    board_only = replace(model, effects=tuple(p for p in model.effects if p.effect.link == "board"))
    return walk(board_only, views.take(np.arange(1))).points_m - views.board.corners_m
