"""The one loop over corners: normal equations of each frame in the frame's own quantities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from calib.chain.projection import BROWN, EVERYTHING, FIRST_RARE, LAST_RARE, K, _corner, _has_rare
from calib.views import FloatArray


# One flat loop: this is where all the time goes, and numba inlines nothing across arrays.
@njit(cache=True, nogil=True, error_model="numpy")
def _accumulate(optics, poses, points, uv, weight, active, basis, gram, residual, cross, own):  # type: ignore[no-untyped-def]  # noqa: C901
    shift = np.zeros(5)
    m = np.zeros(9)
    jt = np.zeros(4)
    jp = np.zeros((2, 6))
    jo = np.zeros((2, K))
    seen = np.zeros(2)
    ka = active.shape[0]
    nb = basis.shape[0]
    q = ka + 6 + nb + 1
    row = np.zeros((2, q))
    jx = np.zeros((2, 3))
    corners = own.shape[0] > 0
    rare = False
    for k in range(ka):
        rare = rare or FIRST_RARE <= active[k] <= LAST_RARE
    for i in range(poses.shape[0]):
        o = optics[i].copy()
        g = gram[i]
        derive = EVERYTHING if rare or _has_rare(o) else BROWN
        for j in range(points.shape[0]):
            w = weight[i, j]
            if w == 0.0:
                continue
            p = points[j]
            _corner(o, poses[i], p[0], p[1], p[2], seen, jp, jo, shift, m, jt, derive)
            for c in range(2):
                for k in range(ka):
                    row[c, k] = jo[c, active[k]]
                for k in range(6):
                    row[c, ka + k] = jp[c, k]
                if nb > 0 or corners:
                    for k in range(3):
                        jx[c, k] = (
                            jp[c, 0] * poses[i, 0, k]
                            + jp[c, 1] * poses[i, 1, k]
                            + jp[c, 2] * poses[i, 2, k]
                        )
                for k in range(nb):
                    row[c, ka + 6 + k] = (
                        jx[c, 0] * basis[k, j, 0]
                        + jx[c, 1] * basis[k, j, 1]
                        + jx[c, 2] * basis[k, j, 2]
                    )
                row[c, q - 1] = uv[i, j, c] - seen[c]
                residual[i, j, c] = row[c, q - 1]
            for a in range(q):
                ua = w * row[0, a]
                va = w * row[1, a]
                for b in range(a, q):
                    g[a, b] += ua * row[0, b] + va * row[1, b]
            if corners:
                for a in range(2):
                    for b in range(q):
                        cross[i, j, a, b] = w * (jx[0, a] * row[0, b] + jx[1, a] * row[1, b])
                    for b in range(2):
                        own[i, j, a, b] = w * (jx[0, a] * jx[0, b] + jx[1, a] * jx[1, b])
        for a in range(q):
            for b in range(a):
                g[a, b] = g[b, a]


@dataclass(frozen=True)
class LocalEquations:
    """Normal equations of N frames in local columns.

    The Q local columns are the A active optics, the pose's six, the B board modes, and the
    residual.

    Attributes
    ----------
    gram:
        (N, Q, Q) weighted products of the columns.
    residual_px:
        (N, M, 2) observed minus predicted; NaN where nothing was seen.
    cross, own:
        (N, M, 2, Q) and (N, M, 2, 2): products with each corner's own in-plane shift, or None.
    """

    gram: FloatArray
    residual_px: FloatArray
    cross: FloatArray | None
    own: FloatArray | None


def local_equations(
    optics: FloatArray,
    camera_from_board: FloatArray,
    points_m: FloatArray,
    corners_px: FloatArray,
    weight: FloatArray,
    active: tuple[int, ...],
    modes: FloatArray,
    *,
    corners: bool = False,
) -> LocalEquations:
    """Go once over every corner of every frame.

    Parameters
    ----------
    optics, camera_from_board, points_m:
        (N, K), (N, 4, 4), (M, 3): the chain's state.
    corners_px, weight:
        (N, M, 2) and (N, M); a corner of weight zero is not looked at.
    active:
        Indices of the optics columns that anything depends on.
    modes:
        (B, M, 3) movements of the board's corners.
    corners:
        Whether each corner may also shift by itself within the board's plane.
    """
    n, m = weight.shape
    q = len(active) + 6 + len(modes) + 1
    gram = np.zeros((n, q, q))
    residual = np.full((n, m, 2), np.nan)
    cross = np.zeros((n, m, 2, q) if corners else (0, 0, 2, q))
    own = np.zeros((n, m, 2, 2) if corners else (0, 0, 2, 2))
    _accumulate(
        np.ascontiguousarray(optics),
        np.ascontiguousarray(camera_from_board),
        np.ascontiguousarray(points_m),
        np.ascontiguousarray(corners_px),
        np.ascontiguousarray(weight),
        np.array(active, dtype=np.int64),
        np.ascontiguousarray(modes.reshape(len(modes), m, 3)),
        gram,
        residual,
        cross,
        own,
    )
    return LocalEquations(gram, residual, cross if corners else None, own if corners else None)
