"""Maximum likelihood with a free pose for each frame: Zhang's fit, and the fixed-alpha fit.

Zhang 2000 (Eq. 14 there; Eq. 3 of the paper) frees one alpha and beta for all frames; the paper's
Eqs. 21 and 24 hold them at the value of each frame's distance. Both are this fit with other
columns free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain import rigid
from calib.chain.optics import COLUMN
from calib.solver.accumulate import local_equations
from calib.solver.elimination import FrameEquations, eliminate, solve_scaled
from calib.views import FloatArray

_NO_MODES = np.zeros((0, 0, 3))


@dataclass(frozen=True)
class FreePoseFit:
    """The result of `fit_free_poses`.

    Attributes
    ----------
    optics, camera_from_board:
        (N, K) and (N, 4, 4) at the optimum.
    residual_px:
        (N, M, 2) observed minus predicted, NaN where nothing was seen.
    covariance:
        (p, p) of the free columns, for corner noise as large as the residuals say.
    sigma_px:
        That noise, one sigma per axis.
    iterations, converged:
        How it went.
    """

    optics: FloatArray
    camera_from_board: FloatArray
    residual_px: FloatArray
    covariance: FloatArray
    sigma_px: float
    iterations: int
    converged: bool


def _equations(
    optics: FloatArray,
    poses: FloatArray,
    points_m: FloatArray,
    corners_px: FloatArray,
    weight: FloatArray,
    active: tuple[int, ...],
) -> tuple[FrameEquations, FloatArray]:
    modes = _NO_MODES.reshape(0, len(points_m), 3)
    local = local_equations(optics, poses, points_m, corners_px, weight, active, modes)
    a = len(active)
    gram = local.gram
    equations = FrameEquations(
        own=gram[:, a : a + 6, a : a + 6],
        own_shared=gram[:, a : a + 6, :a],
        own_residual=gram[:, a : a + 6, -1],
        shared=gram[:, :a, :a].sum(axis=0),
        shared_residual=gram[:, :a, -1].sum(axis=0),
        square_sum=float(gram[:, -1, -1].sum()),
    )
    return equations, local.residual_px


def fit_free_poses(
    optics: FloatArray,
    camera_from_board: FloatArray,
    points_m: FloatArray,
    corners_px: FloatArray,
    free: tuple[str, ...],
    *,
    weight: FloatArray | None = None,
    max_iterations: int = 100,
) -> FreePoseFit:
    """Fit shared optics columns and a pose for each frame by Levenberg-Marquardt.

    Parameters
    ----------
    optics:
        (N, K) start; columns that are not free keep their per-frame values.
    camera_from_board:
        (N, 4, 4) start.
    points_m, corners_px:
        (M, 3) board corners and (N, M, 2) observations, NaN where not seen.
    free:
        Names of the columns that all frames share and the fit may change.
    weight:
        (N, M) relative weights; one where it is not given.
    """
    active = tuple(COLUMN[name] for name in free)
    seen = np.isfinite(corners_px).all(axis=2)
    counted: FloatArray = np.asarray(seen * (1.0 if weight is None else weight), dtype=np.float64)
    optics, poses = optics.copy(), camera_from_board.copy()
    damping, converged, iteration = 1e-6, False, 0
    equations, residual = _equations(optics, poses, points_m, corners_px, counted, active)
    while iteration < max_iterations and not converged:
        iteration += 1
        reduced = eliminate(equations, np.zeros((6, 6)), damping)
        matrix = reduced.shared + damping * np.diag(np.diag(reduced.shared))
        step, _, _ = solve_scaled(matrix, reduced.shared_residual)
        own = reduced.at_zero - reduced.back @ step
        trial_optics = optics.copy()
        trial_optics[:, active] += step
        trial_poses = rigid.product(rigid.from_vector(own), poses)
        trial, trial_residual = _equations(
            trial_optics, trial_poses, points_m, corners_px, counted, active
        )
        if trial.square_sum <= equations.square_sum * (1.0 + 1e-15):
            gain = 1.0 - trial.square_sum / max(equations.square_sum, 1e-300)
            optics, poses, equations, residual = trial_optics, trial_poses, trial, trial_residual
            converged = gain < 1e-10
            damping = max(damping * 0.1, 1e-12)
        else:
            damping = damping * 10.0
            converged = damping > 1e10
    reduced = eliminate(equations, np.zeros((6, 6)))
    _, inverse, _ = solve_scaled(reduced.shared, reduced.shared_residual)
    freedom = max(2 * int(seen.sum()) - len(active) - 6 * len(poses), 1)
    sigma = float(np.sqrt(equations.square_sum / freedom))
    return FreePoseFit(
        optics, poses, residual, inverse * sigma**2, sigma, iteration, damping <= 1e10
    )
