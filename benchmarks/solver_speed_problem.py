"""The problem of `solver_speed.py`, the same for every solver: board, true camera, views."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.views import Board, FloatArray

BOARD = Board("chessboard", rows=14, cols=14, square_m=0.0125)
WIDTH, HEIGHT = 4096, 3072
FREE = ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2", "p1", "p2")
TRUE = optics_row(
    alpha_px=4750.0,
    beta_px=4755.0,
    u0_px=2040.0,
    v0_px=1541.0,
    k1=-0.1,
    k2=0.05,
    p1=3e-4,
    p2=-2e-4,
    height_px=HEIGHT,
)


def observed(frames: int) -> tuple[FloatArray, FloatArray]:
    """(N, M, 2) corners and (N, 4, 4) true poses."""
    rng = np.random.default_rng(1)
    distance = rng.uniform(0.35, 1.0, frames)
    azimuth, tilt = rng.uniform(0, 2 * np.pi, frames), np.radians(rng.uniform(0, 45, frames))
    axis = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1)
    roll = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, frames)[:, None] * [[0.0, 0.0, 1.0]])
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = (Rotation.from_rotvec(axis * tilt[:, None]) * roll).as_matrix()
    aim = np.column_stack([rng.uniform(-0.06, 0.06, (frames, 2)), np.ones(frames)])
    poses[:, :3, 3] = aim * distance[:, None] - poses[:, :3, :3] @ BOARD.corners_m.mean(axis=0)
    optics = np.repeat(TRUE[None], frames, axis=0)
    corners = project(optics, poses, BOARD.corners_m)
    corners += rng.normal(0, 0.1, corners.shape)
    return corners, poses
