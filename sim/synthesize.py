"""Corners without pictures: the chain evaluated forward, plus scatter of arm and detector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.model import CellModel, Errors, evaluate
from calib.chain.sight import in_domain
from calib.chain.state import ChainState
from calib.views import BoolArray, FloatArray, Views
from sim.arm import Repeatability
from sim.cell import ARM_STREAM, CORNER_STREAM, SimulatedCell


def synthesize(cell: SimulatedCell, log: Views) -> Views:
    """The recording that this cell would make at the logged poses.

    Parameters
    ----------
    cell:
        The truth, its noise and its seed.
    log:
        Joints, poses and times (see `sim.log.tour`); its corners are not looked at.

    Returns
    -------
    The log with corners, and with the focus distance where the lens focuses by itself. A frame
    in which a chessboard is not whole in the picture, or is seen from behind, has no corners;
    of a ChArUco board those in the picture stay.
    """
    return synthesize_corners(
        cell.model,
        log,
        corner_sigma_px=cell.corner_sigma_px,
        repeatability=cell.repeatability,
        arm_rng=cell.random(ARM_STREAM),
        corner_rng=cell.random(CORNER_STREAM),
        log_focus=cell.camera.focus in ("auto", "motorised"),
    )


def synthesize_corners(
    model: CellModel,
    log: Views,
    *,
    corner_sigma_px: float,
    repeatability: Repeatability,
    arm_rng: np.random.Generator,
    corner_rng: np.random.Generator,
    log_focus: bool = False,
) -> Views:
    """`synthesize` for a chain of one's own, as Monte Carlo runs need it.

    Parameters
    ----------
    model, log:
        The truth, and what the arm logs.
    corner_sigma_px:
        One sigma per axis of every corner.
    repeatability:
        Scatter of the flange, drawn for each frame.
    arm_rng, corner_rng:
        Where the scatter comes from.
    log_focus:
        Whether the camera reports what distance it is focused at.
    """
    errors = repeatability.draw(arm_rng, (len(log),))
    state = evaluate(model, log, errors=Errors(errors))
    corners = state.pixels()
    corners += corner_sigma_px * corner_rng.standard_normal(corners.shape)
    corners[~_visible(state, corners, log)] = np.nan
    focus = state.focused_m if log_focus else log.focus_distance_m
    return replace(log, corners_px=corners, focus_distance_m=focus)


def true_corners(cell: SimulatedCell, log: Views) -> FloatArray:
    """(N, M, 2) pixels without any scatter, in the picture or not."""
    return evaluate(cell.model, log).pixels()


def _visible(state: ChainState, corners_px: FloatArray, log: Views) -> BoolArray:
    """(N, M) corners that the lens shows, on the printed side, inside the picture."""
    pose = state.camera_from_board
    in_camera = state.points_m @ np.swapaxes(pose[:, :3, :3], 1, 2) + pose[:, None, :3, 3]
    facing = np.einsum("ni,ni->n", pose[:, :3, 2], pose[:, :3, 3]) > 0
    size = np.array([log.width_px, log.height_px])
    inside = ((corners_px > -0.5) & (corners_px < size - 0.5)).all(axis=2)
    seen = inside & in_domain(state.optics, in_camera) & facing[:, None]
    if not log.board.identified:
        seen &= seen.all(axis=1, keepdims=True)
    return np.asarray(seen)
