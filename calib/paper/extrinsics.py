"""Board poses from homographies and intrinsics (the paper's Eqs. 16-20, completed).

Eq. 20 leaves the scale rho undefined and its sign open, and the text's `Q = U S V`, `R = U V^T`
is no rotation for half of all inputs; here rho is the mean of the two column norms, the sign puts
the board in front of the camera, and the nearest rotation is `U diag(1, 1, det(U V^T)) V^T`.
"""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """(..., 3, 3) rotation nearest to `matrix` in the Frobenius norm."""
    u, _, vt = np.linalg.svd(matrix)
    sign = np.ones((*matrix.shape[:-2], 3))
    sign[..., 2] = np.linalg.det(u @ vt)
    return np.asarray((u * sign[..., None, :]) @ vt)


def board_poses(homographies: FloatArray, camera_matrices: FloatArray) -> FloatArray:
    """Closed-form camera_from_board of every view.

    Parameters
    ----------
    homographies:
        (N, 3, 3) image_from_plane, any scale and sign.
    camera_matrices:
        (N, 3, 3) or (3, 3), A of Eq. 2; one per view where the focus moves.

    Returns
    -------
    (N, 4, 4) camera_from_board, board in front of the camera.
    """
    columns = np.linalg.solve(np.broadcast_to(camera_matrices, homographies.shape), homographies)
    norms = np.linalg.norm(columns[:, :, :2], axis=1).sum(axis=1)
    rho = 2 / norms * np.where(columns[:, 2, 2] < 0, -1.0, 1.0)
    r1, r2, t = np.moveaxis(columns * rho[:, None, None], 2, 0)
    poses = np.tile(np.eye(4), (len(homographies), 1, 1))
    poses[:, :3, :3] = nearest_rotation(np.stack([r1, r2, np.cross(r1, r2)], axis=2))
    poses[:, :3, 3] = t
    return poses
