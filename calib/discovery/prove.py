"""Proof: whole frames that were never fitted, predicted before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.model import CellModel, Errors, kinematics_of, predict
from calib.chain.projection import project_with_jacobians
from calib.solver.joint import JointFit
from calib.solver.noise import Noise
from calib.solver.unknowns import dependence
from calib.views import BoolArray, Views

HELD_OUT_EVERY = 8
_FEWEST_TO_SPLIT = 12


def held_out(frames: int) -> BoolArray:
    """(N,) which frames are kept from every fit: one in eight, none of fewer than twelve."""
    chosen = np.zeros(frames, dtype=bool)
    if frames >= _FEWEST_TO_SPLIT:
        chosen[HELD_OUT_EVERY // 2 :: HELD_OUT_EVERY] = True
    return chosen


def prediction_rms_px(model: CellModel, views: Views) -> float:
    """RMS distance of the corners from where the cell, at the logged poses, would show them."""
    miss = views.corners_px - predict(model, views)
    square = np.nansum(miss**2, axis=2)[views.seen]
    return float(np.sqrt(square.mean())) if len(square) else float("nan")


@dataclass(frozen=True)
class Floor:
    """What no model can go below, and how likely a model makes the held-out frames.

    Attributes
    ----------
    noise_px:
        RMS distance that corner noise and the robot's scatter alone make.
    nll_per_frame:
        Negative log likelihood of the held-out corners, per frame.
    """

    noise_px: float
    nll_per_frame: float


def floor_of(model: CellModel, views: Views, noise: Noise) -> Floor:
    """Prediction error that noise alone makes on these frames, and how likely they are."""
    errors = Errors(focal=np.zeros(len(views)) if noise.focal > 0.0 else None)
    found = dependence(model, views, (), kinematics=kinematics_of(views), errors=errors)
    state = found.state
    pixels, j_pose, j_optics = project_with_jacobians(
        state.optics, state.camera_from_board, state.points_m
    )
    columns = np.concatenate([j_optics[..., list(found.active)], j_pose], axis=-1)
    jacobian = columns @ found.own[:, None]
    spread = np.linalg.inv(noise.own_information)
    seen_px = state.straightened(views.corners_px)
    square, nll = [], 0.0
    for i in range(len(views)):
        seen = views.seen[i]
        j = jacobian[i, seen].reshape(-1, len(spread))
        covariance = j @ spread @ j.T + noise.corner_px**2 * np.eye(len(j))
        miss = (seen_px[i, seen] - pixels[i, seen]).ravel()
        _, log_det = np.linalg.slogdet(covariance)
        nll += 0.5 * float(miss @ np.linalg.solve(covariance, miss) + log_det)
        square.append(np.diag(covariance).reshape(-1, 2).sum(axis=1))
    mean = np.concatenate(square).mean() if square else float("nan")
    return Floor(float(np.sqrt(mean)), nll / max(len(views), 1))


@dataclass(frozen=True)
class Proof:
    """Held-out frames before and after; sizes in px (RMS distance)."""

    frames: tuple[int, ...]
    rms_px_before: float
    rms_px_after: float
    noise_px: float
    nll_before: float
    nll_after: float


def prove(before: JointFit, after: JointFit, views: Views) -> Proof | None:
    """Predict the held-out views with both fits; None where nothing was held out."""
    if len(views) == 0:
        return None
    floor = floor_of(after.model, views, after.noise)
    return Proof(
        frames=tuple(int(f) for f in views.frame),
        rms_px_before=prediction_rms_px(before.model, views),
        rms_px_after=prediction_rms_px(after.model, views),
        noise_px=floor.noise_px,
        nll_before=floor_of(before.model, views, before.noise).nll_per_frame,
        nll_after=floor.nll_per_frame,
    )
