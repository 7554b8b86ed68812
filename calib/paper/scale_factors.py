"""Scale factors of near-parallel views from known distances (the paper's Eqs. 11-15).

The paper averages the increments between neighbouring corners, times d/dt. That average sees only
the outer columns (efficiency 0.49 on a 10 x 7 board, 0.08 with a median); here the whole view's
homography is used, which is fully efficient and knows the tilt: with the distance d given, the
homography G = s diag(alpha, beta, 1) [r1 r2 t] about the principal point has s = g33/d, and the
two columns' orthonormality is linear in 1/alpha^2 and 1/beta^2. At zero tilt this is Eq. 15.

What cannot be known here: a view fixes alpha_i/d_i only. An unknown offset d0 of all distances
gives alpha_i (1 - d0/D_i), a curve of its own; `alpha_per_distance_px_m` says how much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import CalibrationError
from calib.paper.homography import Homography, fit_homography
from calib.views import FloatArray

_CORNERS_NEEDED = 8


@dataclass(frozen=True)
class ScaleFactor:
    """The scale factors of one view.

    Attributes
    ----------
    frame:
        Frame number.
    distance_m:
        Depth of the board's centre along the optical axis.
    alpha_px, beta_px, alpha_sigma_px, beta_sigma_px:
        Scale factors and their one-sigma: from the corners and the distance's own error, without
        the error common to all distances.
    alpha_per_distance_px_m, beta_per_distance_px_m:
        What a metre of error in the distance does to them.
    tilt_rad:
        Angle between the board's normal and the optical axis.
    """

    frame: int
    distance_m: float
    alpha_px: float
    alpha_sigma_px: float
    beta_px: float
    beta_sigma_px: float
    alpha_per_distance_px_m: float
    beta_per_distance_px_m: float
    tilt_rad: float


def scale_factor(
    plane_m: FloatArray,
    ideal_px: FloatArray,
    distance_m: float,
    principal_px: tuple[float, float],
    *,
    frame: int = 0,
    distance_sigma_m: float = 0.0,
    sigma_px: FloatArray | None = None,
) -> ScaleFactor:
    """Both scale factors of one view whose distance is known.

    Parameters
    ----------
    plane_m:
        (M, 2) corners in the board's plane.
    ideal_px:
        (M, 2) their pixels with lens distortion removed; NaN where unseen.
    distance_m, distance_sigma_m:
        Depth of the centre of `plane_m` along the optical axis, and its own one-sigma.
    principal_px:
        u0, v0; the paper takes the image's centre. A view this parallel hardly depends on it.
    sigma_px:
        (M,) relative one-sigma of the corners.

    Raises
    ------
    CalibrationError
        Too few corners, a distance that is not positive, or a view tilted too far.
    """
    if not distance_m > 0:
        raise CalibrationError(f"frame {frame}: distance {distance_m} m is not positive")
    if np.isfinite(ideal_px).all(axis=1).sum() < _CORNERS_NEEDED:
        raise CalibrationError(f"frame {frame}: fewer than {_CORNERS_NEEDED} corners seen")
    centred_m = plane_m - (plane_m.min(axis=0) + plane_m.max(axis=0)) / 2
    view = fit_homography(centred_m, ideal_px - np.asarray(principal_px), sigma_px)
    scale, gradient, tilt = _solve_with_gradient(view, distance_m)
    corner_variance = np.einsum("ki,ij,kj->k", gradient, view.covariance, gradient)
    per_metre = scale / distance_m / np.cos(tilt) ** 2
    sigma = np.sqrt(corner_variance + (per_metre * distance_sigma_m) ** 2)
    return ScaleFactor(
        frame=frame,
        distance_m=distance_m,
        alpha_px=float(scale[0]),
        alpha_sigma_px=float(sigma[0]),
        beta_px=float(scale[1]),
        beta_sigma_px=float(sigma[1]),
        alpha_per_distance_px_m=float(per_metre[0]),
        beta_per_distance_px_m=float(per_metre[1]),
        tilt_rad=tilt,
    )


def _solve_with_gradient(
    view: Homography, distance_m: float
) -> tuple[FloatArray, FloatArray, float]:
    h = view.matrix.ravel()[:8]
    # The squares of the noisy perspective terms are too large by their variance.
    variance = np.diag(view.covariance)[6:] * distance_m**2
    value, tilt = _solve(h, distance_m, variance)
    gradient = np.empty((2, 8))
    for k in range(8):
        step = 1e-6 * max(abs(h[k]), np.sqrt(view.covariance[k, k]), 1e-9)
        up, down = h.copy(), h.copy()
        up[k] += step
        down[k] -= step
        plus, minus = _solve(up, distance_m, variance)[0], _solve(down, distance_m, variance)[0]
        gradient[:, k] = (plus - minus) / (2 * step)
    return value, gradient, tilt


def _solve(h: FloatArray, distance_m: float, variance: FloatArray) -> tuple[FloatArray, float]:
    """(alpha, beta) and tilt from the eight elements of G, g33 = 1."""
    g = h[:6].reshape(2, 3)[:, :2] * distance_m
    r31, r32 = h[6:] * distance_m
    rows = np.array(
        [
            [g[0, 0] ** 2, g[1, 0] ** 2],
            [g[0, 1] ** 2, g[1, 1] ** 2],
            [np.sqrt(2) * g[0, 0] * g[0, 1], np.sqrt(2) * g[1, 0] * g[1, 1]],
        ]
    )
    squares = np.array([r31**2 - variance[0], r32**2 - variance[1]])
    right = np.array([1 - squares[0], 1 - squares[1], -np.sqrt(2) * r31 * r32])
    scale = np.abs(rows).max()
    inverse_squares = np.linalg.lstsq(rows / scale, right, rcond=None)[0] / scale
    if not (inverse_squares > 0).all():
        raise CalibrationError("this view is tilted too far to give scale factors")
    tilt = float(np.arcsin(np.sqrt(np.clip(squares.sum(), 0.0, 1.0))))
    return 1 / np.sqrt(inverse_squares), tilt


def paper_scale_factor(
    plane_m: FloatArray, image_px: FloatArray, distance_m: float, columns: int
) -> tuple[float, float]:
    """Eqs. 14, 15 as printed: mean increments between neighbours, times d/dt.

    For comparison; it knows neither tilt nor roll nor distortion.

    Parameters
    ----------
    plane_m, image_px:
        (M, 2) corners row by row and their pixels, all seen.
    distance_m, columns:
        The view's distance, the corners in a row.
    """
    grid = image_px.reshape(-1, columns, 2)
    pitch = float(np.linalg.norm(plane_m[1] - plane_m[0]))
    across = np.linalg.norm(np.diff(grid, axis=1), axis=2).mean()
    down = np.linalg.norm(np.diff(grid, axis=0), axis=2).mean()
    along_u = abs(grid[0, -1, 0] - grid[0, 0, 0]) >= abs(grid[0, -1, 1] - grid[0, 0, 1])
    du, dv = (across, down) if along_u else (down, across)
    return float(du * distance_m / pitch), float(dv * distance_m / pitch)
