"""Per-frame unknowns eliminated: what is left are the shared ones.

Each frame contributes normal equations in some numbers of its own and the p shared ones; the
Schur complement takes its own out (Triggs et al. 2000, Bundle adjustment, section 6.1). With a
prior on them this is the marginal likelihood of a linear mixed model: a noisy robot pose is
nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calib.views import FloatArray

UNDETERMINED = 1e-10
"""Relative eigenvalue below which a direction is what rounding in the derivatives made it."""


@dataclass(frozen=True)
class FrameEquations:
    """Normal equations of N frames in their own F numbers, p shared ones and the residual.

    The own numbers are six of a pose, and a seventh where something else scatters frame by frame.

    Attributes
    ----------
    own, own_shared, own_residual:
        (N, F, F), (N, F, p), (N, F).
    shared, shared_residual:
        (p, p) and (p,), summed over the frames.
    square_sum:
        Weighted sum of squared residuals.
    """

    own: FloatArray
    own_shared: FloatArray
    own_residual: FloatArray
    shared: FloatArray
    shared_residual: FloatArray
    square_sum: float


def joined(parts: Sequence[FrameEquations]) -> FrameEquations:
    """The equations of all frames from those of consecutive blocks of them."""
    return FrameEquations(
        own=np.concatenate([part.own for part in parts]),
        own_shared=np.concatenate([part.own_shared for part in parts]),
        own_residual=np.concatenate([part.own_residual for part in parts]),
        shared=np.sum([part.shared for part in parts], axis=0),
        shared_residual=np.sum([part.shared_residual for part in parts], axis=0),
        square_sum=sum(part.square_sum for part in parts),
    )


@dataclass(frozen=True)
class Reduced:
    """Shared equations with the frames' own numbers eliminated.

    Attributes
    ----------
    shared, shared_residual, square_sum:
        (p, p), (p,) and the square sum that remains at shared increments of zero.
    log_det_own:
        Sum over frames of the log-determinants of the eliminated blocks.
    back, at_zero:
        (N, F, p) and (N, F): own = at_zero - back @ shared.
    own_covariance:
        (N, F, F) inverse of the eliminated blocks.
    """

    shared: FloatArray
    shared_residual: FloatArray
    square_sum: float
    log_det_own: float
    back: FloatArray
    at_zero: FloatArray
    own_covariance: FloatArray


def eliminate(equations: FrameEquations, prior: FloatArray, damping: float = 0.0) -> Reduced:
    """Take the frames' own numbers out.

    Parameters
    ----------
    equations:
        See `FrameEquations`.
    prior:
        (F, F) or (N, F, F) information of the own numbers, added to their blocks.
    damping:
        Levenberg-Marquardt factor on the own blocks' diagonals.
    """
    own = equations.own + prior
    if damping:
        own = own + damping * own * np.eye(own.shape[1])
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("nii->ni", own), 1e-300))
    normal = own * scale[:, :, None] * scale[:, None, :]
    covariance = np.linalg.inv(normal) * scale[:, :, None] * scale[:, None, :]
    back = covariance @ equations.own_shared
    at_zero = np.einsum("nij,nj->ni", covariance, equations.own_residual)
    n, f, p = equations.own_shared.shape
    gathered = equations.own_shared.reshape(n * f, p)
    shared = equations.shared - gathered.T @ back.reshape(n * f, p)
    shared_residual = equations.shared_residual - gathered.T @ at_zero.reshape(-1)
    _, log_det = np.linalg.slogdet(normal)
    return Reduced(
        shared=0.5 * (shared + shared.T),
        shared_residual=shared_residual,
        square_sum=equations.square_sum - float(np.sum(equations.own_residual * at_zero)),
        log_det_own=float(np.sum(log_det - 2.0 * np.log(scale).sum(axis=1))),
        back=back,
        at_zero=at_zero,
        own_covariance=covariance,
    )


def solve_scaled(matrix: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Solve a positive definite system after scaling its diagonal to one.

    Returns
    -------
    The solution, the inverse of the matrix, and its log-determinant. Directions that the data do
    not determine (relative eigenvalue below `UNDETERMINED`) are left where they are.
    """
    if matrix.size == 0:  # only the frames' own numbers are free
        return right.copy(), matrix.copy(), 0.0
    diagonal = np.diag(matrix).copy()
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 0.0)
    normal = matrix * scale[:, None] * scale[None, :]
    try:
        factor = cho_factor(normal, lower=True)
        if np.diag(factor[0]).min() ** 2 > UNDETERMINED:
            inverse = cho_solve(factor, np.eye(len(normal)))
            log_det = 2.0 * float(np.sum(np.log(np.diag(factor[0]))) - np.sum(np.log(scale)))
            inverse = inverse * scale[:, None] * scale[None, :]
            return inverse @ right, inverse, log_det
    except np.linalg.LinAlgError:
        pass
    eigenvalue, vector = np.linalg.eigh(normal)
    kept = eigenvalue > UNDETERMINED * max(float(eigenvalue[-1]), 1e-300)
    root = (vector[:, kept] / np.sqrt(eigenvalue[kept])) * scale[:, None]
    inverse = root @ root.T
    log_det = float(np.sum(np.log(eigenvalue[kept])))
    log_det -= 2.0 * float(np.sum(np.log(scale[scale > 0.0])))
    return inverse @ right, inverse, log_det
