"""The plain cell: constant focal length, two radial terms, hand-eye, rigid board, arm as logged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.baseline import Baseline
from calib.chain.effect import Present
from calib.chain.model import CellModel
from calib.chain.optics import COLUMN
from calib.handeye import HandEye, solve_hand_eye
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import unknowns_of
from calib.views import BoolArray, FloatArray, Views


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


UNKNOWN_POSE = (0.3, 1.0)
"""A flange scatter (metres, radians) so large that an absent robot has no influence."""


@dataclass(frozen=True)
class Fitter:
    """How cells are fitted to these views: with the robot's word for its poses, or without."""

    views: Views
    has_robot: bool = True

    def fit(
        self,
        model: CellModel,
        noise: Noise,
        own_error: FloatArray | None = None,
        weight: FloatArray | None = None,
        *,
        fixed_noise: bool = False,
    ) -> JointFit:
        """Fit the cell, with whatever effects it has; the corners' weights too if not given."""
        if self.has_robot:
            return fit_joint(
                model,
                self.views,
                unknowns_of(model),
                noise,
                own_error=own_error,
                fixed_noise=fixed_noise,
                weight=weight,
            )
        unheard = replace(noise, flange_m=UNKNOWN_POSE[0], flange_rad=UNKNOWN_POSE[1])
        unknowns = unknowns_of(model, poses=False)
        return fit_joint(
            model,
            self.views,
            unknowns,
            unheard,
            own_error=own_error,
            fixed_noise=True,
            weight=weight,
        )

    def with_effects(self, start: JointFit, effects: Sequence[Present]) -> JointFit:
        """Fit a cell with these effects from where another fit stands, corners weighted alike."""
        model = start.model.with_effects(effects)
        return self.fit(model, start.noise, start.own_error, start.weight)

    def settled(self, start: JointFit) -> JointFit:
        """Fit the same cell with the corners' weights estimated anew."""
        return self.fit(start.model, start.noise, start.own_error)


_PRINT_WORTH = 10.0
"""Freeing every corner must lower -2 log likelihood by this much to be kept."""

_MOST_FREE_CORNERS = 150
_PRINT_GUESS_M = 2e-5


def fit_start(
    fitter: Fitter, free: FreeViews, train: BoolArray, known: Sequence[Present] = ()
) -> JointFit:
    """Fit the plain cell, with printed corners free where the data ask for it.

    Parameters
    ----------
    fitter:
        Of the frames to fit.
    free:
        What the pictures say, of all frames.
    train:
        (N,) which of all frames are the fitter's.
    known:
        Effects that the pictures alone have shown.
    """
    views = fitter.views
    poses = free.camera_from_board[train]
    if fitter.has_robot:
        model, hand_eye = plain_model(replace(free, camera_from_board=poses), views)
        noise = noise_guess(free, hand_eye)
    else:
        model = CellModel(free.optics, np.eye(4), np.eye(4))
        noise = Noise(max(free.sigma_px, 1e-3), *UNKNOWN_POSE)
    fit = fitter.fit(model.with_effects(known), noise)
    if not fitter.has_robot or views.board.corner_count > _MOST_FREE_CORNERS:
        return fit
    guess = replace(fit.noise, print_m=_PRINT_GUESS_M)
    freed = fitter.fit(fit.model, guess, fit.own_error, fit.weight)
    better = freed.minus_two_log < fit.minus_two_log - _PRINT_WORTH
    return fitter.settled(freed) if better else fit
