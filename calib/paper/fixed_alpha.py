"""The paper's fit: scale factors held at their distance's value, all else free (Eqs. 20, 21, 24).

Eq. 23 maps distorted to ideal points while Eq. 24 needs the inverse, and gives r in pixels while
its k1, k2 are normalised; here, as in Zhang's fit, k1 and k2 distort normalised coordinates.
"""

from __future__ import annotations

import numpy as np

from calib.chain.optics import COLUMN, optics_row
from calib.chain.projection import project
from calib.paper.extrinsics import board_poses
from calib.paper.zhang import camera_matrix
from calib.solver.free_poses import FreePoseFit, fit_free_poses
from calib.views import FloatArray

FREE = ("u0_px", "v0_px", "skew_px", "k1", "k2")
"""What Eq. 24 frees besides the poses."""

_DISTORTION = [COLUMN[name] for name in ("k1", "k2", "p1", "p2", "k3")]


def held_optics(
    alpha_px: FloatArray, beta_px: FloatArray, width_px: int, height_px: int
) -> FloatArray:
    """(N, K) start: given scale factors, principal point at the centre, nothing else."""
    base = optics_row(u0_px=(width_px - 1) / 2, v0_px=(height_px - 1) / 2, height_px=height_px)
    optics = np.tile(base, (len(alpha_px), 1))
    optics[:, COLUMN["alpha_px"]] = alpha_px
    optics[:, COLUMN["beta_px"]] = beta_px
    return optics


def algebraic_poses(optics: FloatArray, homographies: FloatArray) -> FloatArray:
    """(N, 4, 4) camera_from_board of each view with its own A_i (Eq. 20)."""
    return board_poses(homographies, camera_matrix(optics))


def fit_fixed_alpha(
    optics: FloatArray,
    camera_from_board: FloatArray,
    points_m: FloatArray,
    corners_px: FloatArray,
    weight: FloatArray,
) -> FreePoseFit:
    """Maximum likelihood with alpha and beta of every frame held (Eq. 24).

    Parameters
    ----------
    optics, camera_from_board:
        (N, K) and (N, 4, 4) start; alpha and beta are kept.
    points_m, corners_px, weight:
        (M, 3), (N, M, 2), (N, M).
    """
    return fit_free_poses(optics, camera_from_board, points_m, corners_px, FREE, weight=weight)


def without_distortion(
    corners_px: FloatArray, optics: FloatArray, camera_from_board: FloatArray, points_m: FloatArray
) -> FloatArray:
    """(N, M, 2) corners less the distortion that a model has at its own predictions."""
    ideal = optics.copy()
    ideal[:, _DISTORTION] = 0.0
    bent = project(optics, camera_from_board, points_m)
    return np.asarray(corners_px - bent + project(ideal, camera_from_board, points_m))
