"""Small synthetic cells for the tests of the paper's method."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.optics import COLUMN, optics_row
from calib.chain.projection import project
from calib.chain.rigid import compose, inverse
from calib.views import Board, FloatArray, Mount, Views

BOARD = Board("chessboard", rows=7, cols=10, square_m=0.025)
WIDTH, HEIGHT = 4096, 3072
ALPHA0, BETA0, U0, V0 = 4755.8, 4760.0, 2052.0, 1548.0
FLANGE_FROM_MOUNTED = compose(np.array([0.02, -0.03, 0.7]), np.array([0.03, -0.04, 0.09]))
BASE_FROM_FIXED = compose(np.array([0.1, 3.0, 0.2]), np.array([0.7, 0.1, 0.3]))


@dataclass(frozen=True)
class Scene:
    """Views with the truth behind them: (N, 4, 4) poses and (N, K) optics."""

    views: Views
    camera_from_board: FloatArray
    optics: FloatArray

    @property
    def depth_m(self) -> FloatArray:
        centre = np.append(BOARD.corners_m.mean(axis=0), 1.0)
        return (self.camera_from_board @ centre)[:, 2]


def poses(distance_m: FloatArray, tilt_deg: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(N, 4, 4) camera_from_board looking at the board's centre, roughly centred."""
    n = len(distance_m)
    azimuth = rng.uniform(0, 2 * np.pi, n)
    axis = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n)], axis=1)
    tilt = Rotation.from_rotvec(axis * np.radians(tilt_deg)[:, None])
    roll = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, n)[:, None] * [[0.0, 0.0, 1.0]])
    out = np.tile(np.eye(4), (n, 1, 1))
    out[:, :3, :3] = (tilt * roll).as_matrix()
    aim = np.column_stack([rng.uniform(-0.04, 0.04, (n, 2)), np.ones(n)]) * distance_m[:, None]
    out[:, :3, 3] = aim - out[:, :3, :3] @ BOARD.corners_m.mean(axis=0)
    return out


def scene(
    *,
    distance_m: FloatArray,
    tilt_deg: FloatArray,
    seed: int = 1,
    noise_px: float = 0.0,
    k_px_m2: float = 0.0,
    thin_f_m: float = 0.0,
    k1: float = 0.0,
    k2: float = 0.0,
    robot_mm: float = 0.0,
    robot_deg: float = 0.0,
    mount: Mount = "eye_in_hand",
) -> Scene:
    rng = np.random.default_rng(seed)
    truth = poses(distance_m, tilt_deg, rng)
    scale = (1 - k_px_m2 / ALPHA0 / distance_m**2) * distance_m / (distance_m - thin_f_m)
    base = optics_row(u0_px=U0, v0_px=V0, k1=k1, k2=k2, height_px=HEIGHT)
    optics = np.tile(base, (len(truth), 1))
    optics[:, COLUMN["alpha_px"]] = ALPHA0 * scale
    optics[:, COLUMN["beta_px"]] = BETA0 * scale
    corners = project(optics, truth, BOARD.corners_m)
    corners += rng.normal(0, 1, corners.shape) * noise_px
    board_from_camera = inverse(truth)
    loop = board_from_camera if mount == "eye_in_hand" else truth
    flange = BASE_FROM_FIXED @ loop @ inverse(FLANGE_FROM_MOUNTED)
    jitter = compose(
        rng.normal(0, np.radians(robot_deg) + 1e-15, (len(truth), 3)),
        rng.normal(0, robot_mm / 1000 + 1e-15, (len(truth), 3)),
    )
    blank = Views.blank(BOARD, width_px=WIDTH, height_px=HEIGHT, frames=len(truth), mount=mount)
    views = replace(blank, corners_px=corners, base_from_flange=flange @ jitter)
    return Scene(views, truth, optics)


def mixed_scene(parallel: int = 12, tilted: int = 15, **keywords: object) -> Scene:
    """Parallel views over the distances, then tilted ones (20 to 40 degrees)."""
    near_far = np.geomspace(0.3, 1.5, parallel)
    rng = np.random.default_rng(99)
    distance = np.concatenate([near_far, rng.uniform(0.35, 1.0, tilted)])
    tilt = np.concatenate([rng.uniform(0, 0.8, parallel), rng.uniform(20, 40, tilted)])
    return scene(distance_m=distance, tilt_deg=tilt, **keywords)  # type: ignore[arg-type]
