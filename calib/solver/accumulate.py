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
    _corners,
    _has_rare,
    _take,
)
from calib.chain.rows import BLOCK, JAC, OPTIC, ROW, WORK, U, V
from calib.views import FloatArray

LEFT, RIGHT = 2, 4
"""Rows whose products are summed together: each is read from the cache that much less often."""


# Rows are taken as slices: an index that may be negative for all the compiler knows would keep it
# from going several corners at a time.
@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _add_products(rows, length, gram):  # type: ignore[no-untyped-def]
    """Add the products of (Q, length) rows to the upper triangle of `gram`, by small tiles."""
    last = rows.shape[0] - 1
    for a in range(0, last + 1, LEFT):
        a0, a1 = rows[a], rows[min(a + 1, last)]
        for b in range(a, last + 1, RIGHT):
            b0, b1 = rows[b], rows[min(b + 1, last)]
            b2, b3 = rows[min(b + 2, last)], rows[min(b + 3, last)]
            s00 = s01 = s02 = s03 = s10 = s11 = s12 = s13 = 0.0
            for k in range(length):
                s00 += a0[k] * b0[k]
                s01 += a0[k] * b1[k]
                s02 += a0[k] * b2[k]
                s03 += a0[k] * b3[k]
                s10 += a1[k] * b0[k]
                s11 += a1[k] * b1[k]
                s12 += a1[k] * b2[k]
                s13 += a1[k] * b3[k]
            sums = ((s00, s01, s02, s03), (s10, s11, s12, s13))
            for i in range(min(LEFT, last + 1 - a)):
                for j in range(min(RIGHT, last + 1 - b)):
                    gram[a + i, b + j] += sums[i][j]


@njit(cache=True, error_model="numpy")
def _weigh(source, root, full, row):  # type: ignore[no-untyped-def]
    """A row of derivatives times the roots of the weights: of u, and at once behind it of v."""
    of_v, to_v = source[BLOCK:], row[full:]
    for j in range(full):
        row[j] = root[j] * source[j]
    for j in range(full):
        to_v[j] = root[j] * of_v[j]


@njit(cache=True, error_model="numpy")
def _by_point(jac, rotation, count, by_point):  # type: ignore[no-untyped-def]
    """Derivatives by the point in the board's frame, a row for each of its axes."""
    for k in range(3):
        r0, r1, r2 = rotation[0, k], rotation[1, k], rotation[2, k]
        for half in (0, BLOCK):
            for j in range(half, half + count):
                by_point[k * ROW + j] = r0 * jac[j] + r1 * jac[ROW + j] + r2 * jac[2 * ROW + j]


@njit(cache=True, error_model="numpy")
def _weigh_modes(by_point, basis, chosen, root, count, full, rows, to):  # type: ignore[no-untyped-def]
    """Derivatives by the board's modes, weighted."""
    for k in range(basis.shape[0]):
        rows[to + k, : 2 * full] = 0.0
        for c in range(2):
            for j in range(count):
                move, here = basis[k, chosen[j]], c * BLOCK + j
                rows[to + k, c * full + j] = root[j] * (
                    by_point[here] * move[0]
                    + by_point[ROW + here] * move[1]
                    + by_point[2 * ROW + here] * move[2]
                )


@njit(cache=True, error_model="numpy")
def _add_corners(by_point, rows, chosen, root, count, full, cross, own):  # type: ignore[no-untyped-def]
    """Products with each corner's own in-plane shift; `rows` carry the root of its weight."""
    for j in range(count):
        to_cross, to_own = cross[chosen[j]], own[chosen[j]]
        for a in range(2):
            u, v = root[j] * by_point[a * ROW + j], root[j] * by_point[a * ROW + BLOCK + j]
            for b in range(rows.shape[0]):
                to_cross[a, b] = u * rows[b, j] + v * rows[b, full + j]
            for b in range(2):
                to_own[a, b] = root[j] * (
                    u * by_point[b * ROW + j] + v * by_point[b * ROW + BLOCK + j]
                )


@njit(cache=True, error_model="numpy")
def _misses(uv, chosen, count, full, work, residual, off):  # type: ignore[no-untyped-def]
    """Observed less predicted, into the frame's residuals and into a row."""
    for j in range(count):
        at = chosen[j]
        off[j] = residual[at, 0] = uv[at, 0] - work[U + j]
        off[BLOCK + j] = residual[at, 1] = uv[at, 1] - work[V + j]
    for j in range(count, full):
        off[j] = off[BLOCK + j] = 0.0


@njit(cache=True, error_model="numpy")
def _choose(weight, chosen):  # type: ignore[no-untyped-def]
    """The corners that count, into `chosen`; how many they are."""
    seen = 0
    for j in range(weight.shape[0]):
        if weight[j] != 0.0:
            chosen[seen] = j
            seen += 1
    return seen


@njit(cache=True, error_model="numpy")
def _mirror(gram):  # type: ignore[no-untyped-def]
    for a in range(gram.shape[0]):
        for b in range(a):
            gram[a, b] = gram[b, a]


# This is where all the time goes.
@njit(cache=True, nogil=True, error_model="numpy")
def _accumulate(optics, poses, points, uv, weight, active, basis, gram, residual, cross, own):  # type: ignore[no-untyped-def]
    work, jac, off, by_point = np.zeros(WORK), np.zeros(JAC), np.zeros(ROW), np.zeros(3 * ROW)
    ka, nb = active.shape[0], basis.shape[0]
    q = ka + 6 + nb + 1
    rows, root = np.zeros((q, ROW)), np.zeros(BLOCK)
    chosen = np.empty(points.shape[0], np.int64)
    corners = own.shape[0] > 0
    rare = np.any((active >= FIRST_RARE) & (active <= LAST_RARE))
    for i in range(poses.shape[0]):
        seen = _choose(weight[i], chosen)
        derive = EVERYTHING if rare or _has_rare(optics[i]) else BROWN
        # blocks of one length: a short one at the end would be filled up in vain
        parts = (seen + BLOCK - 1) // BLOCK
        length = (seen + parts - 1) // max(parts, 1)
        for first in range(0, seen, max(length, 1)):
            count = min(length, seen - first)
            these = chosen[first : first + count]
            full = _take(points, these, count, work)
            _corners(optics[i], poses[i], full, work, jac, derive)
            _misses(uv[i], these, count, full, work, residual[i], off)
            for j in range(count):
                root[j] = math.sqrt(weight[i, these[j]])
            root[count:full] = 0.0
            for k in range(ka):
                at = OPTIC + active[k] * ROW
                _weigh(jac[at : at + ROW], root, full, rows[k])
            for k in range(6):
                _weigh(jac[k * ROW : (k + 1) * ROW], root, full, rows[ka + k])
            if nb > 0 or corners:
                _by_point(jac, poses[i], count, by_point)
                _weigh_modes(by_point, basis, these, root, count, full, rows, ka + 6)
            _weigh(off, root, full, rows[q - 1])
            if corners:
                _add_corners(by_point, rows, these, root, count, full, cross[i], own[i])
            _add_products(rows, 2 * full, gram[i])
        _mirror(gram[i])


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
