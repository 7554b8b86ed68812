"""How far each picture's camera pose is from the one a cell model gives at the logged pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain import rigid
from calib.chain.model import CellModel, evaluate
from calib.chain.optics import COLUMN
from calib.chain.projection import project_with_jacobians
from calib.chain.state import ChainState
from calib.views import BoolArray, FloatArray, Views

_STEPS = 8
_ANYWHERE = rigid.from_vector(np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
"""In front of the camera: a frame without a pose must not divide by its depth."""
_DEPTH = 2
_SCALE = [COLUMN["alpha_px"], COLUMN["beta_px"]]


@dataclass(frozen=True)
class PoseErrors:
    """What a free pose of each frame absorbs, and what it cannot; N frames.

    Attributes
    ----------
    state:
        The state that the model gives.
    error:
        (N, 6) error of the camera's pose by the model against the picture's: metres in the camera
        frame, then a rotation vector; NaN where a frame has no pose or too few corners.
    residual_px:
        (N, M, 2) observed minus predicted at the picture's own pose.
    """

    state: ChainState
    error: FloatArray
    residual_px: FloatArray

    @property
    def shift_m(self) -> FloatArray:
        """(N, 3) position part."""
        return self.error[:, :3]

    @property
    def turn_rad(self) -> FloatArray:
        """(N, 3) orientation part."""
        return self.error[:, 3:]


def pose_errors(model: CellModel, views: Views) -> PoseErrors:
    """Free every frame's camera pose, starting from the model's, until the corners fit best."""
    state = evaluate(model, views)
    start = state.camera_from_board
    usable: BoolArray = np.isfinite(start).all(axis=(1, 2)) & (views.seen.sum(axis=1) >= 4)
    pose = np.where(usable[:, None, None], start, _ANYWHERE)
    for _ in range(_STEPS):
        residual, j_pose, _ = _linear(state, pose, views, state.optics)
        pose = rigid.from_vector(_least_squares(j_pose, residual)) @ pose
    residual, _, _ = _linear(state, pose, views, state.optics)
    error = rigid.to_vector(np.where(usable[:, None, None], start, pose) @ rigid.inverse(pose))
    error[~usable] = np.nan
    residual[~usable] = np.nan
    return PoseErrors(state, error, np.where(views.seen[..., None], residual, np.nan))


def scale_at_robot_depth(
    found: PoseErrors, views: Views, corner_px: float, flange_m: float
) -> tuple[FloatArray, FloatArray]:
    """(N,) scale factor alpha of each frame when the model's depth is believed, and its sigma.

    The frame's pose is free but for its depth, and alpha and beta stretch together: what Eqs. 14
    and 15 of Ricolfe-Viala and Esparza measure, for a view of any tilt. Depth noise of `flange_m`
    and corner noise of `corner_px` make the sigma.
    """
    state = found.state
    usable: BoolArray = np.asarray(np.isfinite(found.error).all(axis=1))
    pose = np.where(usable[:, None, None], state.camera_from_board, _ANYWHERE)
    optics = state.optics.copy()
    for _ in range(_STEPS):
        residual, j_pose, j_optics = _linear(state, pose, views, optics)
        jacobian = j_pose.copy()
        jacobian[..., _DEPTH] = np.einsum("nmak,nk->nma", j_optics[..., _SCALE], optics[:, _SCALE])
        step = _least_squares(jacobian, residual)
        optics[:, _SCALE] *= 1 + step[:, [_DEPTH]]
        step[:, _DEPTH] = 0.0
        pose = rigid.from_vector(step) @ pose
    alpha = optics[:, COLUMN["alpha_px"]]
    own = np.linalg.pinv(_normal(jacobian))[:, _DEPTH, _DEPTH] * corner_px**2
    sigma = alpha * np.sqrt(own + (flange_m / state.distance_m) ** 2)
    return np.where(usable, alpha, np.nan), np.where(usable, sigma, np.nan)


def without_constant_part(found: PoseErrors) -> FloatArray:
    """(N, 6) errors less what new constant hand-eye and board poses would take up.

    A constant error of the transform next to the camera is the same in every frame; one next to
    the board reaches the camera through the adjoint of its pose.
    """
    usable: BoolArray = np.asarray(np.isfinite(found.error).all(axis=1))
    camera_from_board = found.state.camera_from_board[usable]
    if len(camera_from_board) < 3:
        return found.error
    columns = np.concatenate(
        [np.tile(np.eye(6), (len(camera_from_board), 1, 1)), rigid.adjoint(camera_from_board)],
        axis=2,
    )
    # a radian moves the board by its distance: so both kinds count alike
    weight = np.r_[np.ones(3), np.full(3, float(np.median(found.state.distance_m[usable])))]
    design = (columns * weight[:, None]).reshape(-1, 12)
    target = (found.error[usable] * weight).ravel()
    constant = np.linalg.lstsq(design, target, rcond=None)[0]
    out = found.error.copy()
    out[usable] -= columns @ constant
    return out


def _linear(
    state: ChainState, pose: FloatArray, views: Views, optics: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals (N, M, 2) and Jacobians by pose and optics, zero where no corner was seen."""
    pixels, j_pose, j_optics = project_with_jacobians(optics, pose, state.points_m)
    seen = views.seen[..., None]
    residual = np.where(seen, np.nan_to_num(state.straightened(views.corners_px)) - pixels, 0.0)
    return residual, np.where(seen[..., None], j_pose, 0.0), j_optics * seen[..., None]


def _least_squares(jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    """(N, 6) steps; a frame without corners gets none."""
    right = np.einsum("nmax,nma->nx", jacobian, residual)
    return np.asarray((np.linalg.pinv(_normal(jacobian)) @ right[..., None])[..., 0])


def _normal(jacobian: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nmax,nmay->nxy", jacobian, jacobian))
