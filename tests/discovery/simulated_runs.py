"""Small recordings of corners from a UR5e with an eye in hand, everything logged."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from calib.chain.effect import Present
from calib.chain.kinematics import arm
from calib.chain.model import CellModel
from calib.chain.optics import optics_row
from calib.chain.rigid import compose, inverse
from calib.solver.noise import Noise
from calib.solver.pose_information import shown
from calib.views import Board, FloatArray, Views
from cell.storage.files.board_file import board_file
from cell.storage.recording import Recording
from cell.storage.recording.header import Header
from sim.arm import Repeatability
from sim.cell import CameraSpec, SimulatedCell
from sim.log import tour
from sim.synthesize import synthesize_corners

BOARD = Board("chessboard", rows=5, cols=8, square_m=0.03)
WIDTH, HEIGHT = 2048, 1536
NOISE = Noise(corner_px=0.1, flange_m=3e-5, flange_rad=1e-4)
HOME_RAD = np.array([0.2, -1.6, 1.7, -1.7, -1.5, 0.3])
FLANGE_FROM_CAMERA = compose(np.array([0.02, -0.03, 0.7]), np.array([0.03, -0.04, 0.09]))
AHEAD = compose(np.array([0.05, 0.1, 0.1]), np.array([-0.1, -0.06, 0.55]))
OPTICS = optics_row(
    alpha_px=2400.0, beta_px=2404.0, u0_px=1020.0, v0_px=770.0, k1=-0.08, k2=0.05, height_px=HEIGHT
)


def plain_cell() -> CellModel:
    """The cell with nothing wrong."""
    base_from_board = arm("ur5e").forward(HOME_RAD) @ FLANGE_FROM_CAMERA @ AHEAD
    return CellModel(OPTICS, FLANGE_FROM_CAMERA, base_from_board)


def simulated_cell(effects: Iterable[Present] = (), seed: int = 1) -> SimulatedCell:
    """The same cell as the simulator has it."""
    return SimulatedCell(
        name="bench",
        robot_model="ur5e",
        home_rad=HOME_RAD,
        board=BOARD,
        model=plain_cell().with_effects(effects),
        camera=CameraSpec(WIDTH, HEIGHT, 0.012, 4.0),
        repeatability=Repeatability(NOISE.flange_m, NOISE.flange_rad),
        corner_sigma_px=NOISE.corner_px,
        payload_kg=1.2,
        seed=seed,
    )


def _look(rng: np.random.Generator) -> FloatArray:
    """camera_from_board: any distance, roll and tilt up to 0.6 rad, board near the middle."""
    azimuth, tilt, roll = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 0.6), rng.uniform(-1.5, 1.5)
    lean = compose(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]), np.zeros(3))
    turn = (compose(np.array([0.0, 0.0, roll]), np.zeros(3)) @ lean)[:3, :3]
    distance = rng.uniform(0.36, 0.9)
    aim = distance * np.array([*rng.uniform(-0.12, 0.12, 2), 1.0])
    pose = np.eye(4)
    pose[:3, :3] = turn
    pose[:3, 3] = aim - turn @ BOARD.corners_m.mean(axis=0)
    return pose


@cache
def joints(frames: int, seed: int) -> FloatArray:
    """(N, 6) joint angles of random views that the arm reaches and that show the whole board."""
    kinematics, cell = arm("ur5e"), plain_cell()
    rng = np.random.default_rng(seed)
    found: list[FloatArray] = []
    while len(found) < frames:
        pose = cell.base_from_fixed @ inverse(_look(rng)) @ inverse(cell.flange_from_mounted)
        near = kinematics.inverse_all(pose, HOME_RAD)
        if len(near) and np.abs(near[0] - HOME_RAD).max() < 2.0 and _whole(cell, pose):
            found.append(near[0])
    return np.array(found)


def _whole(cell: CellModel, base_from_flange: FloatArray) -> bool:
    blank = Views.blank(BOARD, width_px=WIDTH, height_px=HEIGHT, frames=1)
    views = replace(blank, base_from_flange=base_from_flange[None])
    return bool(shown(cell, views).seen.all())


def log(frames: int, seed: int = 7, *, moving: bool = False) -> Views:
    """What the arm logs on a tour of random views."""
    speeds = None
    if moving:
        speeds = np.random.default_rng(seed + 1).uniform(-0.4, 0.4, (frames, 6))
    return tour(simulated_cell(), joints(frames, seed), joint_velocity_rad_s=speeds, dwell_s=20.0)


def record(model: CellModel, views: Views, seed: int, noise: Noise = NOISE) -> Views:
    """The recording that this cell makes at the logged poses, with noise."""
    rng = np.random.default_rng(seed)
    made = synthesize_corners(
        model,
        views,
        corner_sigma_px=noise.corner_px,
        repeatability=Repeatability(noise.flange_m, noise.flange_rad),
        arm_rng=rng,
        corner_rng=rng,
    )
    return made.take(np.asarray(made.seen.any(axis=1)))


def recording() -> Recording:
    """What a recording of these runs says of itself; it has no files."""
    header = Header.model_validate(
        {
            "schema": "cell.recording/1",
            "robot": {"model": "ur5e"},
            "camera": {"width": WIDTH, "height": HEIGHT},
            "board": board_file(BOARD).model_dump(),
        }
    )
    return Recording(Path("bench"), header, ())
