"""A cell with an arm of known kinematics, everything logged, and nothing wrong with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.kinematics import arm
from calib.chain.model import CellModel
from calib.chain.optics import optics_row
from calib.chain.rigid import compose, inverse
from calib.views import Board, FloatArray, Mount, Views

BOARD = Board("chessboard", rows=7, cols=10, square_m=0.025)
WIDTH, HEIGHT = 1280, 960
ARM = "ur5e"
MIDDLE_RAD = np.array([0.3, -1.5, 1.6, -1.7, -1.5, 0.4])
FLANGE_FROM_MOUNTED = compose(np.array([0.02, -0.03, 0.7]), np.array([0.03, -0.04, 0.09]))
BOARD_AHEAD = compose(np.array([0.3, 0.2, 0.1]), np.array([-0.1, -0.08, 0.55]))
OPTICS = optics_row(
    alpha_px=1500.0, beta_px=1510.0, u0_px=640.0, v0_px=470.0, k1=-0.1, k2=0.03, height_px=HEIGHT
)


def cell(mount: Mount = "eye_in_hand", frames: int = 12, seed: int = 3) -> tuple[CellModel, Views]:
    """A plain cell and the log of a run in which every joint, speed and time differs."""
    rng = np.random.default_rng(seed)
    kinematics = arm(ARM)
    joints = MIDDLE_RAD + rng.uniform(-0.12, 0.12, (frames, 6))
    middle = kinematics.forward(MIDDLE_RAD)
    # an eye in hand sees the board of the base; a fixed eye the board of the flange
    seen = BOARD_AHEAD if mount == "eye_in_hand" else inverse(BOARD_AHEAD)
    model = CellModel(OPTICS, FLANGE_FROM_MOUNTED, middle @ FLANGE_FROM_MOUNTED @ seen)
    blank = Views.blank(BOARD, width_px=WIDTH, height_px=HEIGHT, frames=frames, mount=mount)
    views = replace(
        blank,
        base_from_flange=kinematics.forward(joints),
        joints_rad=joints,
        joint_velocity_rad_s=rng.uniform(-0.5, 0.5, (frames, 6)),
        approach_joints_rad=joints + rng.uniform(-0.1, 0.1, (frames, 6)),
        t_s=np.linspace(0.0, 1800.0, frames),
        exposure_s=rng.uniform(0.004, 0.02, frames),
        temperature_c=np.linspace(21.0, 33.0, frames),
        extra={"gain_db": rng.choice([0.0, 3.0, 6.0], frames)},
        robot_model=ARM,
        payload_kg=1.2,
        moving=True,
    )
    return model, views


def mirrored(views: Views) -> Views:
    """The same run seen with the roles of base and flange exchanged."""
    mount: Mount = "eye_to_hand" if views.mount == "eye_in_hand" else "eye_in_hand"
    flange: FloatArray = inverse(views.base_from_flange)
    return replace(views, mount=mount, base_from_flange=flange)
