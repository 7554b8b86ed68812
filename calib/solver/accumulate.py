"""The one loop over corners: normal equations of each frame in the frame's own quantities."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from calib.chain.projection import (
    BROWN,
    EVERYTHING,
    FIRST_RARE,
    LAST_RARE,
    K,
    _corner,
    _has_rare,
    _has_sweep,
    _swept,
    _tilt_of,
)
from calib.views import FloatArray

BLOCK = 64
"""Corners whose derivatives are gathered before they are multiplied: they stay in the cache."""


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _add_products(rows, count, gram):  # type: ignore[no-untyped-def]
    """Add the products of (Q, count) rows to the upper triangle of `gram`, four at a time."""
    q = rows.shape[0]
    for a in range(q):
        left = rows[a]
        b = a
        while b + 4 <= q:
            first, second, third, fourth = rows[b], rows[b + 1], rows[b + 2], rows[b + 3]
            s0 = 0.0
            s1 = 0.0
            s2 = 0.0
            s3 = 0.0
            for k in range(count):
                s0 += left[k] * first[k]
                s1 += left[k] * second[k]
                s2 += left[k] * third[k]
                s3 += left[k] * fourth[k]
            gram[a, b] += s0
            gram[a, b + 1] += s1
            gram[a, b + 2] += s2
            gram[a, b + 3] += s3
            b += 4
        while b < q:
            right = rows[b]
            s0 = 0.0
            for k in range(count):
                s0 += left[k] * right[k]
            gram[a, b] += s0
            b += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _add_corner(w, jx, rows, at, cross, own):  # type: ignore[no-untyped-def]
    """Products of one corner's own in-plane shift; `rows` carry the root of its weight."""
    root = math.sqrt(w)
    for a in range(2):
        for b in range(rows.shape[0]):
            cross[a, b] = root * (jx[0, a] * rows[b, at] + jx[1, a] * rows[b, at + 1])
        for b in range(2):
            own[a, b] = w * (jx[0, a] * jx[0, b] + jx[1, a] * jx[1, b])


# One flat loop: this is where all the time goes, and numba inlines nothing across arrays.
@njit(cache=True, nogil=True, error_model="numpy")
def _accumulate(optics, poses, points, uv, weight, active, basis, gram, residual, cross, own):  # type: ignore[no-untyped-def]  # noqa: C901
    shift = np.zeros(5)
    tilt = np.zeros(4)
    jt = np.zeros(4)
    jp = np.zeros((2, 6))
    jo = np.zeros((2, K))
    jx = np.zeros((2, 3))
    seen = np.zeros(2)
    ka = active.shape[0]
    nb = basis.shape[0]
    q = ka + 6 + nb + 1
    rows = np.zeros((q, 2 * BLOCK))
    corners = own.shape[0] > 0
    rare = False
    for k in range(ka):
        rare = rare or FIRST_RARE <= active[k] <= LAST_RARE
    for i in range(poses.shape[0]):
        o = optics[i]
        pose = poses[i]
        _tilt_of(o, tilt)
        derive = EVERYTHING if rare or _has_rare(o) else BROWN
        sweeps = _has_sweep(o)
        filled = 0
        for j in range(points.shape[0]):
            w = weight[i, j]
            if w == 0.0:
                continue
            p = points[j]
            _corner(o, tilt, pose, p[0], p[1], p[2], seen, jp, jo, shift, jt, derive)
            if sweeps:
                _swept(o, tilt, pose, p[0], p[1], p[2], seen, jp, jo, shift, jt, derive)
            root = math.sqrt(w)
            for c in range(2):
                at = filled + c
                for k in range(ka):
                    rows[k, at] = root * jo[c, active[k]]
                for k in range(6):
                    rows[ka + k, at] = root * jp[c, k]
                if nb > 0 or corners:
                    for k in range(3):
                        jx[c, k] = (
                            jp[c, 0] * pose[0, k] + jp[c, 1] * pose[1, k] + jp[c, 2] * pose[2, k]
                        )
                for k in range(nb):
                    rows[ka + 6 + k, at] = root * (
                        jx[c, 0] * basis[k, j, 0]
                        + jx[c, 1] * basis[k, j, 1]
                        + jx[c, 2] * basis[k, j, 2]
                    )
                residual[i, j, c] = uv[i, j, c] - seen[c]
                rows[q - 1, at] = root * residual[i, j, c]
            if corners:
                _add_corner(w, jx, rows, filled, cross[i, j], own[i, j])
            filled += 2
            if filled == 2 * BLOCK:
                _add_products(rows, filled, gram[i])
                filled = 0
        _add_products(rows, filled, gram[i])
        for a in range(q):
            for b in range(a):
                gram[i, a, b] = gram[i, b, a]


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
