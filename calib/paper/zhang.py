"""Zhang's closed form: one set of intrinsics from the homographies of all views.

Z. Zhang, "A flexible new technique for camera calibration", IEEE TPAMI 22(11), 2000, section 3.1.
"""

from __future__ import annotations

import numpy as np

from calib.chain.optics import COLUMN, optics_row
from calib.errors import CalibrationError
from calib.paper.extrinsics import board_poses
from calib.views import FloatArray


def camera_matrix(optics: FloatArray) -> FloatArray:
    """(..., 3, 3) A of the paper's Eq. 2 from (..., K) optics."""
    A = np.zeros((*optics.shape[:-1], 3, 3))
    A[..., 0, 0] = optics[..., COLUMN["alpha_px"]]
    A[..., 0, 1] = optics[..., COLUMN["skew_px"]]
    A[..., 0, 2] = optics[..., COLUMN["u0_px"]]
    A[..., 1, 1] = optics[..., COLUMN["beta_px"]]
    A[..., 1, 2] = optics[..., COLUMN["v0_px"]]
    A[..., 2, 2] = 1.0
    return A


def zhang_camera_matrix(
    homographies: FloatArray, width_px: int, height_px: int, *, skew: bool = True
) -> FloatArray:
    """Camera matrix common to all homographies (Zhang 2000, Eqs. 4-9 and appendix B).

    Parameters
    ----------
    homographies:
        (N, 3, 3) image_from_plane.
    width_px, height_px:
        Used to condition the equations.
    skew:
        False holds the skew at zero, which two views suffice for.

    Returns
    -------
    (3, 3) A of Eq. 2.

    Raises
    ------
    CalibrationError
        Too few views, or views that do not fix the camera (all of one orientation).
    """
    needed = 3 if skew else 2
    if len(homographies) < needed:
        raise CalibrationError(
            f"{len(homographies)} usable views; the closed form needs {needed}: record more"
        )
    scale = (width_px + height_px) / 4
    shrink = np.array(
        [
            [1 / scale, 0, -(width_px - 1) / 2 / scale],
            [0, 1 / scale, -(height_px - 1) / 2 / scale],
            [0, 0, 1],
        ]
    )
    H = shrink @ homographies
    H = H / np.linalg.norm(H[:, :, :2], axis=(1, 2), keepdims=True)
    rows = np.concatenate([_v(H, 0, 1), _v(H, 0, 0) - _v(H, 1, 1)])
    if not skew:
        rows = np.vstack([rows, [0, len(rows), 0, 0, 0, 0]])
    _, singular, vt = np.linalg.svd(rows, full_matrices=False)
    if singular[4] < 1e-7 * singular[0]:
        raise CalibrationError("the views share one orientation and fix no camera: tilt the board")
    return np.asarray(np.linalg.inv(shrink) @ _unpack(vt[5]))


def centred_camera_matrix(homographies: FloatArray, width_px: int, height_px: int) -> FloatArray:
    """Camera matrix with the principal point at the image's centre and no skew.

    Zhang's two constraints per view, linear in 1/alpha^2 and 1/beta^2: a start where the full
    closed form has no real solution.

    Raises
    ------
    CalibrationError
        No real camera fits even so.
    """
    centre = np.array([(width_px - 1) / 2, (height_px - 1) / 2])
    H = homographies.copy()
    H[:, :2] -= centre[:, None] * H[:, 2:]
    H = H / np.linalg.norm(H[:, :2, :2], axis=(1, 2), keepdims=True)
    a, b = H[:, :, 0], H[:, :, 1]
    rows = np.concatenate([a * b, a**2 - b**2])
    size = width_px * height_px / 4
    solution = np.linalg.lstsq(rows[:, :2] * [1 / size, 1 / size], -rows[:, 2], rcond=None)[0]
    if not (solution > 0).all():
        raise CalibrationError(
            "no real camera fits these views: tilt the board 20 to 45 degrees about both axes, or"
            " check the board's rows and columns"
        )
    alpha, beta = np.sqrt(size / solution)
    return np.array([[alpha, 0, centre[0]], [0, beta, centre[1]], [0, 0, 1]])


def _v(H: FloatArray, i: int, j: int) -> FloatArray:
    a, b = H[:, :, i], H[:, :, j]
    return np.stack(
        [
            a[:, 0] * b[:, 0],
            a[:, 0] * b[:, 1] + a[:, 1] * b[:, 0],
            a[:, 1] * b[:, 1],
            a[:, 2] * b[:, 0] + a[:, 0] * b[:, 2],
            a[:, 2] * b[:, 1] + a[:, 1] * b[:, 2],
            a[:, 2] * b[:, 2],
        ],
        axis=1,
    )


def _unpack(b: FloatArray) -> FloatArray:
    B = np.array([[b[0], b[1], b[3]], [b[1], b[2], b[4]], [b[3], b[4], b[5]]])
    B = B if B[0, 0] > 0 else -B
    try:
        lower = np.linalg.cholesky(B)
    except np.linalg.LinAlgError:
        raise CalibrationError(
            "no real camera fits these views in the closed form: tilt the board 20 to 45 degrees"
            " about both axes, or check the board's rows, columns and square"
        ) from None
    A = np.linalg.inv(lower).T
    return np.asarray(A / A[2, 2])


def linear_radial(
    optics: FloatArray,
    camera_from_board: FloatArray,
    points_m: FloatArray,
    corners_px: FloatArray,
) -> tuple[float, float]:
    """k1, k2 by linear least squares, all else held (Zhang 2000, section 3.3, Eq. 13).

    Parameters
    ----------
    optics:
        (N, K) with alpha, beta, skew, u0, v0 set; its distortion is ignored.
    camera_from_board, points_m, corners_px:
        (N, 4, 4), (M, 3), (N, M, 2); unseen corners NaN.
    """
    inside = points_m @ np.swapaxes(camera_from_board[:, :3, :3], 1, 2)
    inside = inside + camera_from_board[:, None, :3, 3]
    xy = inside[..., :2] / inside[..., 2:]
    A = camera_matrix(optics)
    r2 = (xy**2).sum(axis=2)
    from_centre = xy @ np.swapaxes(A[:, :2, :2], 1, 2)
    missing = corners_px - A[:, None, :2, 2] - from_centre
    seen = np.isfinite(corners_px).all(axis=2)
    design = np.stack([from_centre * r2[..., None], from_centre * (r2**2)[..., None]], axis=-1)
    rows, right = design[seen].reshape(-1, 2), missing[seen].ravel()
    k1, k2 = np.linalg.solve(rows.T @ rows, rows.T @ right)
    return float(k1), float(k2)


def zhang_pinhole(
    homographies: FloatArray, width_px: int, height_px: int
) -> tuple[FloatArray, FloatArray]:
    """Zhang's closed form without distortion: (K,) optics and (N, 4, 4) camera_from_board.

    Raises
    ------
    CalibrationError
        When the views do not fix the camera.
    """
    A = zhang_camera_matrix(homographies, width_px, height_px)
    row = optics_row(
        alpha_px=A[0, 0],
        beta_px=A[1, 1],
        skew_px=A[0, 1],
        u0_px=A[0, 2],
        v0_px=A[1, 2],
        height_px=height_px,
    )
    return row, board_poses(homographies, A)


def zhang_algebraic(
    homographies: FloatArray,
    points_m: FloatArray,
    corners_px: FloatArray,
    width_px: int,
    height_px: int,
) -> tuple[FloatArray, FloatArray]:
    """Zhang's closed form with poses and linear k1, k2.

    Parameters
    ----------
    homographies:
        (N, 3, 3) image_from_plane.
    points_m, corners_px:
        (M, 3), (N, M, 2); unseen corners NaN.

    Returns
    -------
    (K,) optics and (N, 4, 4) camera_from_board.

    Raises
    ------
    CalibrationError
        When the views do not fix the camera.
    """
    row, poses = zhang_pinhole(homographies, width_px, height_px)
    row[COLUMN["k1"]], row[COLUMN["k2"]] = linear_radial(
        np.tile(row, (len(poses), 1)), poses, points_m, corners_px
    )
    return row, poses
