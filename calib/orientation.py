"""Gives the corners of a symmetric board the same physical order in every frame.

A chessboard whose rows + cols are even looks the same after half a turn (after a quarter turn
too, where it is square), so a picture alone cannot tell which corner is (0, 0). The robot can:
only one order per frame lets all frames share one hand-eye transform.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.calibration.baseline import fit_baseline
from calib.calibration.frames import usable_frames
from calib.errors import CalibrationError
from calib.handeye import chain, closed_form
from calib.views import Board, FloatArray, Views

_TRIPLES = 30
_AGREE_RAD = np.radians(10.0)
_FRAMES_NEEDED = 4


def orders(board: Board) -> tuple[NDArray[np.int64], ...]:
    """Every (M,) renaming of corners that a picture of the board cannot tell from another.

    The first one changes nothing; new corner m is old corner `order[m]`.
    """
    same = np.arange(board.corner_count).reshape(board.rows, board.cols)
    if board.kind != "chessboard" or (board.rows + board.cols) % 2:
        return (same.ravel(),)
    quarters = (0, 1, 2, 3) if board.rows == board.cols else (0, 2)
    return tuple(np.rot90(same, quarter).ravel() for quarter in quarters)


def same_order_everywhere(views: Views) -> Views:
    """The views with every frame's corners renamed so that the robot's poses agree with them.

    Unchanged where the board is not symmetric, or where fewer than four frames have a pose.
    """
    ways = orders(views.board)
    known = views.has_pose & (views.seen.sum(axis=1) >= 8)
    if len(ways) == 1 or known.sum() < _FRAMES_NEEDED:
        return views
    try:
        baseline = fit_baseline(views, usable_frames(views))
    except CalibrationError:
        return views  # the calibration itself will say what is wrong
    frames = np.flatnonzero(known & baseline.used)
    if len(frames) < _FRAMES_NEEDED:
        return views
    poses = baseline.mle.camera_from_board[frames]
    seen_as = np.stack([poses @ _board_turn(views.board, way) for way in ways], axis=1)
    chosen = _consensus(seen_as, views.base_from_flange[frames], views)
    corners, sigma = views.corners_px.copy(), views.corner_sigma_px.copy()
    for frame, way in zip(frames, chosen, strict=True):
        corners[frame] = views.corners_px[frame, ways[way]]
        sigma[frame] = views.corner_sigma_px[frame, ways[way]]
    return replace(views, corners_px=corners, corner_sigma_px=sigma)


def _board_turn(board: Board, order: NDArray[np.int64]) -> FloatArray:
    """(4, 4) old board frame from new one: it carries corner m to corner order[m]."""
    points = board.corners_m
    centre = points.mean(axis=0)
    rotation, _ = Rotation.align_vectors(points[order] - centre, points - centre)
    turn = np.eye(4)
    turn[:3, :3] = rotation.as_matrix()
    turn[:3, 3] = centre - turn[:3, :3] @ centre
    return turn


def _consensus(seen_as: FloatArray, flange: FloatArray, views: Views) -> NDArray[np.int64]:
    """(N,) which of the (N, W) poses fit one hand-eye transform, tried on triples of frames."""
    rng = np.random.default_rng(0)
    n, ways = seen_as.shape[:2]
    best_cost, best = np.inf, np.zeros(n, dtype=np.int64)
    for _ in range(_TRIPLES):
        triple = rng.choice(n, 3, replace=False)
        for second in range(ways):
            for third in range(ways):
                label = np.array([0, second, third])
                cost, chosen = _judge(seen_as, flange, views, triple, label)
                if cost < best_cost:
                    best_cost, best = cost, chosen
    _, again = _judge(seen_as, flange, views, np.arange(n), best)
    return again


def _judge(
    seen_as: FloatArray,
    flange: FloatArray,
    views: Views,
    frames: NDArray[np.int64],
    label: NDArray[np.int64],
) -> tuple[float, NDArray[np.int64]]:
    X, Z = closed_form(seen_as[frames, label], flange[frames], views.mount)
    robot = chain(views.mount, X, flange, Z)
    trace = np.einsum("nwij,nij->nw", seen_as[:, :, :3, :3], robot[:, :3, :3])
    angle = np.arccos(np.clip((trace - 1) / 2, -1, 1))
    return float(np.minimum(angle.min(axis=1), _AGREE_RAD).sum()), angle.argmin(axis=1)
