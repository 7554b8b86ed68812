"""Views of a wide lens on an arm, the board anywhere in the picture out to its rim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.optics import optics_row
from calib.chain.rigid import compose, inverse
from calib.chain.sight import project
from calib.views import Board, FloatArray, Views
from tests.paper.scene import BASE_FROM_FIXED, FLANGE_FROM_MOUNTED

BOARD = Board("aprilgrid", rows=8, cols=8, square_m=0.03, gap_m=0.009)
WIDTH, HEIGHT = 1280, 960
IDEAL = {"alpha_px": 372.0, "beta_px": 373.0, "u0_px": 645.0, "v0_px": 471.0, "height_px": 960.0}
WIDE = optics_row(**IDEAL, equidistant=1.0, k1=0.03, k2=-0.01, k3=0.003, k4=-0.0006)
PINHOLE = optics_row(**{**IDEAL, "alpha_px": 520.0, "beta_px": 521.0}, k1=-0.05, k2=0.004)


def wide_views(
    optics: FloatArray = WIDE,
    *,
    frames: int = 40,
    widest_deg: float = 70.0,
    noise_px: float = 0.1,
    seed: int = 3,
) -> Views:
    """Each frame looks at the board's middle somewhere up to `widest_deg` off the axis."""
    rng = np.random.default_rng(seed)
    off, around = np.radians(widest_deg) * np.sqrt(rng.random(frames)), rng.uniform(0, 6.3, frames)
    toward = Rotation.from_rotvec(
        np.column_stack([-off * np.sin(around), off * np.cos(around), np.zeros(frames)])
    )
    tilt = Rotation.from_rotvec(rng.normal(0, 0.4, (frames, 3)) * [1, 1, 1.5])
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = (toward * tilt).as_matrix()
    aim = toward.apply([0.0, 0.0, 1.0]) * rng.uniform(0.25, 0.6, frames)[:, None]
    poses[:, :3, 3] = aim - poses[:, :3, :3] @ BOARD.corners_m.mean(axis=0)
    corners = project(np.repeat(optics[None], frames, axis=0), poses, BOARD.corners_m)
    corners += rng.normal(0, noise_px, corners.shape)
    inside = ((corners > 0) & (corners < [WIDTH - 1, HEIGHT - 1])).all(axis=2)
    corners[~inside] = np.nan
    flange = BASE_FROM_FIXED @ inverse(poses) @ inverse(FLANGE_FROM_MOUNTED)
    jitter = compose(rng.normal(0, 5e-5, (frames, 3)), rng.normal(0, 3e-5, (frames, 3)))
    blank = Views.blank(BOARD, width_px=WIDTH, height_px=HEIGHT, frames=frames)
    return replace(blank, corners_px=corners, base_from_flange=flange @ jitter)
