"""The plain cell: constant focal length, two radial terms, hand-eye, rigid board, arm as logged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.calibration.baseline import Baseline
from calib.chain.model import CellModel
from calib.chain.optics import COLUMN
from calib.handeye import HandEye, solve_hand_eye
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import unknowns_of
from calib.views import FloatArray, Views

SMALLEST_PRINT_M = 3e-6


@dataclass(frozen=True)
class FreeViews:
    """What the pictures say without the robot.

    Attributes
    ----------
    optics:
        (K,) one camera for all frames.
    camera_from_board:
        (N, 4, 4) a free pose for each frame, NaN for a frame that was thrown out.
    sigma_px:
        Corner noise per axis, lens and board misfit included.
    """

    optics: FloatArray
    camera_from_board: FloatArray
    sigma_px: float


def free_views(baseline: Baseline, height_px: int) -> FreeViews:
    """Zhang's maximum-likelihood solution as the start of everything else."""
    used = np.flatnonzero(baseline.used)
    optics = baseline.mle.optics[used[0]].copy()
    optics[COLUMN["skew_px"]] = 0.0
    optics[COLUMN["height_px"]] = height_px
    residual = baseline.mle.residual_px
    sigma_px = float(np.sqrt(np.nanmean(residual**2)))
    return FreeViews(optics, baseline.mle.camera_from_board, sigma_px)


def board_centre_m(views: Views) -> FloatArray:
    """(3,) middle of the corner grid in the board's frame."""
    return np.asarray(views.board.corners_m.mean(axis=0))


def plain_model(free: FreeViews, views: Views) -> tuple[CellModel, HandEye]:
    """The plain cell by hand-eye calibration on the free poses.

    Raises
    ------
    CalibrationError
        When the motions do not fix the transforms.
    """
    hand_eye = solve_hand_eye(
        free.camera_from_board, views.base_from_flange, views.mount, board_centre_m(views)
    )
    model = CellModel(free.optics, hand_eye.flange_from_mounted, hand_eye.base_from_fixed)
    return model, hand_eye


def noise_guess(free: FreeViews, hand_eye: HandEye) -> Noise:
    """Noise levels to start from: what the free poses and the hand-eye solution leave over."""
    return Noise(
        corner_px=max(free.sigma_px, 1e-3),
        flange_m=max(hand_eye.rms_m, 1e-5),
        flange_rad=max(hand_eye.rms_rad, 1e-5),
    )


def fit_plain(
    model: CellModel, views: Views, noise: Noise, *, flange_error: FloatArray | None = None
) -> JointFit:
    """Fit the plain cell (with whatever effects it has) to the views."""
    return fit_joint(model, views, unknowns_of(model), noise, flange_error=flange_error)
