"""Plane-to-image homographies: normalised linear start, then least squares in pixels.

The paper's Eq. 19 has the wrong sign in its third block (its null vector is the homography with
the third row negated) and states 12 unknowns where a 3x3 matrix has 9; both are corrected here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from calib.errors import CalibrationError
from calib.views import BoolArray, FloatArray

# Beyond this many sigma a corner is a wrong detection; at 5 a good one is lost once in 270 000.
OUTLIER_SIGMA = 5.0
_RAYLEIGH_MEDIAN = 1.17741

_NEAR_ENOUGH = 1e-8
"""Last step of the robust fit, of the corners' spread: below a ten-thousandth of a pixel."""

_DAMPING = 1e-14
"""Of the normal matrix's trace, so that corners which fix no homography stop nothing here; where
they do fix one, the end is the same."""

_WELL_POSED = 1e-9
"""Least pivot, of the greatest, with which normal equations may give the linear start."""


@dataclass(frozen=True)
class Homography:
    """A homography with what is known of its error.

    Attributes
    ----------
    matrix:
        (3, 3) image_from_plane, pixels from metres, with `matrix[2, 2] == 1`.
    covariance:
        (8, 8) of the first eight elements, row by row, scaled by the residuals.
    inlier:
        (M,) the corners used.
    residual_px:
        (M, 2) detected minus predicted; NaN where no corner was seen.
    sigma_px:
        One sigma per axis of the used corners' residuals.
    """

    matrix: FloatArray
    covariance: FloatArray
    inlier: BoolArray
    residual_px: FloatArray
    sigma_px: float


def apply_homography(matrix: FloatArray, plane_m: FloatArray) -> FloatArray:
    """(..., M, 2) image points of the plane points (M, 2) under (..., 3, 3) homographies."""
    mapped = plane_m @ np.swapaxes(matrix[..., :, :2], -1, -2) + matrix[..., None, :, 2]
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


def linear_homography(plane_m: FloatArray, image_px: FloatArray) -> FloatArray:
    """Normalised direct linear transform (the paper's Eq. 19, sign corrected; Hartley 1997).

    Parameters
    ----------
    plane_m, image_px:
        (M, 2) matching points, at least four.

    Returns
    -------
    (3, 3) image_from_plane, `[2, 2] == 1`.

    Raises
    ------
    CalibrationError
        Fewer than four points, or points on a line.
    """
    if len(plane_m) < 4:
        raise CalibrationError(f"a homography needs 4 corners, {len(plane_m)} were seen")
    to_plane, to_image = _normaliser(plane_m), _normaliser(image_px)
    p = apply_homography(to_plane, plane_m)
    q = apply_homography(to_image, image_px)
    ones = np.column_stack([p, np.ones(len(p))])
    zero = np.zeros_like(ones)
    rows = np.concatenate(
        [
            np.hstack([ones, zero, -q[:, :1] * ones]),
            np.hstack([zero, ones, -q[:, 1:] * ones]),
        ]
    )
    _, singular, vt = np.linalg.svd(rows, full_matrices=len(rows) < 9)
    if singular[7] < 1e-9 * singular[0]:
        raise CalibrationError("the corners seen lie on a line and fix no homography")
    matrix = np.linalg.inv(to_image) @ vt[8].reshape(3, 3) @ to_plane
    return np.asarray(matrix / matrix[2, 2])


def fit_homography(
    plane_m: FloatArray, image_px: FloatArray, sigma_px: FloatArray | None = None
) -> Homography:
    """Least-squares homography in pixels, wrong corners left out.

    Cauchy weights find the wrong corners (measured: one corner 50 sigma off moves a plain fit
    by 4e-3); what is left is fitted unweighted, so that the covariance is the plain one.

    Parameters
    ----------
    plane_m:
        (M, 2) points on the plane, metres.
    image_px:
        (M, 2) their images; rows with NaN were not seen.
    sigma_px:
        (M,) relative one-sigma per corner, or None for equal ones.

    Raises
    ------
    CalibrationError
        Fewer than five corners, or corners on a line.
    """
    seen = _enough(image_px)
    weight = _relative_weights(sigma_px, seen)
    matrix, good = _robust(plane_m[seen], image_px[seen], weight[seen])
    return _with_errors(matrix, plane_m, image_px, weight, seen, good)


def robust_homography(plane_m: FloatArray, image_px: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Matrix and inliers of `fit_homography` alone, in a third of its time; raises as that does."""
    seen = _enough(image_px)
    p = plane_m[seen]
    H, good = _robust(p, image_px[seen], np.ones(len(p)))
    seen[seen] = good
    return H, seen


def _enough(image_px: FloatArray) -> BoolArray:
    seen: BoolArray = np.asarray(np.isfinite(image_px).all(axis=1))
    count = np.count_nonzero(seen)
    if count < 5:
        raise CalibrationError(f"a homography with an error needs 5 corners, {count} seen")
    return seen


def _robust(p: FloatArray, q: FloatArray, w: FloatArray) -> tuple[FloatArray, BoolArray]:
    H = np.empty((3, 3))
    good = np.ones(len(p), dtype=np.bool_)
    if not _fit(p, q, w, H, good, False):
        H[:] = linear_homography(p, q)
        _fit(p, q, w, H, good, True)
    return H, good


def _with_errors(
    matrix: FloatArray,
    plane_m: FloatArray,
    image_px: FloatArray,
    weight: FloatArray,
    seen: BoolArray,
    good: BoolArray,
) -> Homography:
    inlier = seen.copy()
    inlier[seen] = good
    residual = image_px - apply_homography(matrix, plane_m)
    used, counted = residual[inlier], weight[inlier]
    freedom = max(used.size - 8, 1)
    variance = float(counted @ (used**2).sum(axis=1) / freedom)
    N, unused = np.zeros((8, 8)), np.zeros(8)
    _normal_equations(matrix, plane_m[inlier], image_px[inlier], counted, N, unused)
    scale = np.sqrt(np.diag(N))
    covariance = variance * np.linalg.inv(N / np.outer(scale, scale)) / np.outer(scale, scale)
    return Homography(matrix, covariance, inlier, residual, float(np.sqrt(variance)))


def _relative_weights(sigma_px: FloatArray | None, seen: BoolArray) -> FloatArray:
    if sigma_px is None or not np.isfinite(sigma_px[seen]).all():
        return np.ones(len(seen))
    weight = np.where(seen, 1 / np.where(seen, sigma_px, 1.0) ** 2, 0.0)
    return np.asarray(weight / weight[seen].mean())


def _normaliser(points: FloatArray) -> FloatArray:
    centre = points.mean(axis=0)
    spread = np.sqrt(((points - centre) ** 2).sum(axis=1).mean() / 2)
    if not spread > 0:
        raise CalibrationError("all corners seen coincide and fix no homography")
    return np.array(
        [[1 / spread, 0, -centre[0] / spread], [0, 1 / spread, -centre[1] / spread], [0, 0, 1]]
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _add_row_products(x, y, depth, u, v, ru, rv, w, N, right):  # type: ignore[no-untyped-def]
    """Add one corner's part: rows (a, 0, -u p) and (0, a, -v p) over the depth.

    a = (x, y, 1), p = (x, y): the derivative of its image by the first eight elements.
    """
    a = (x / depth, y / depth, 1.0 / depth)
    for i in range(3):
        for j in range(i, 3):
            N[i, j] += w * a[i] * a[j]
        for j in range(2):
            N[i, 6 + j] -= w * u * a[i] * a[j]
            N[3 + i, 6 + j] -= w * v * a[i] * a[j]
        right[i] += w * ru * a[i]
        right[3 + i] += w * rv * a[i]
    for i in range(2):
        for j in range(i, 2):
            N[6 + i, 6 + j] += w * (u * u + v * v) * a[i] * a[j]
        right[6 + i] -= w * (u * ru + v * rv) * a[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _mirror(N):  # type: ignore[no-untyped-def]
    """Fill the second diagonal block and the lower triangle."""
    for i in range(3):
        for j in range(i, 3):
            N[3 + i, 3 + j] = N[i, j]
    for i in range(8):
        for j in range(i):
            N[i, j] = N[j, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _normal_equations(H, p, q, w, N, right):  # type: ignore[no-untyped-def]
    """Gauss-Newton equations of (M, 2) points at H, into (8, 8) and (8,)."""
    N[:, :] = 0.0
    right[:] = 0.0
    for i in range(len(p)):
        x, y = p[i, 0], p[i, 1]
        depth = H[2, 0] * x + H[2, 1] * y + H[2, 2]
        u = (H[0, 0] * x + H[0, 1] * y + H[0, 2]) / depth
        v = (H[1, 0] * x + H[1, 1] * y + H[1, 2]) / depth
        _add_row_products(x, y, depth, u, v, q[i, 0] - u, q[i, 1] - v, w[i], N, right)
    _mirror(N)


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(N, right):  # type: ignore[no-untyped-def]
    """Cholesky's solution into `right`; the least pivot as a share of its diagonal element."""
    damping = 0.0
    for i in range(8):
        damping += _DAMPING * N[i, i]
    least = 1.0
    for i in range(8):
        whole = N[i, i] + damping
        for j in range(i + 1):
            rest = whole if i == j else N[i, j]
            for k in range(j):
                rest -= N[i, k] * N[j, k]
            if i > j:
                N[i, j] = rest / N[j, j]
            else:
                least = min(least, rest / whole)
                N[i, i] = math.sqrt(max(rest, 1e-300))
    for i in range(8):
        for k in range(i):
            right[i] -= N[i, k] * right[k]
        right[i] /= N[i, i]
    for i in range(7, -1, -1):
        for k in range(i + 1, 8):
            right[i] -= N[k, i] * right[k]
        right[i] /= N[i, i]
    return least


@njit(cache=True, nogil=True, error_model="numpy")
def _centred(points, out):  # type: ignore[no-untyped-def]
    """Points about their centre, of unit spread, into `out`; centre and spread."""
    m = len(points)
    cx = 0.0
    cy = 0.0
    for i in range(m):
        cx += points[i, 0] / m
        cy += points[i, 1] / m
    square = 0.0
    for i in range(m):
        square += (points[i, 0] - cx) ** 2 + (points[i, 1] - cy) ** 2
    spread = math.sqrt(square / m / 2.0)
    for i in range(m):
        out[i, 0] = (points[i, 0] - cx) / spread
        out[i, 1] = (points[i, 1] - cy) / spread
    return cx, cy, spread


@njit(cache=True, nogil=True, error_model="numpy")
def _squares(H, p, q, w, out):  # type: ignore[no-untyped-def]
    """(M,) weighted squared distances into `out`; their robust one-sigma per axis."""
    for i in range(len(p)):
        x, y = p[i, 0], p[i, 1]
        depth = H[2, 0] * x + H[2, 1] * y + H[2, 2]
        ru = q[i, 0] - (H[0, 0] * x + H[0, 1] * y + H[0, 2]) / depth
        rv = q[i, 1] - (H[1, 0] * x + H[1, 1] * y + H[1, 2]) / depth
        out[i] = w[i] * (ru * ru + rv * rv)
    return math.sqrt(np.median(out)) / _RAYLEIGH_MEDIAN


@njit(cache=True, nogil=True, error_model="numpy")
def _step(H, p, q, w, N, right):  # type: ignore[no-untyped-def]
    """One Gauss-Newton step; its largest element."""
    _normal_equations(H, p, q, w, N, right)
    _solve(N, right)
    largest = 0.0
    for k in range(8):
        H[k // 3, k % 3] += right[k]
        largest = max(largest, abs(right[k]))
    return largest


@njit(cache=True, nogil=True, error_model="numpy")
def _linear(p, q, H, N, right):  # type: ignore[no-untyped-def]
    """Direct linear transform by normal equations; the least pivot, as `_solve`."""
    N[:, :] = 0.0
    right[:] = 0.0
    for i in range(len(p)):
        u, v = q[i, 0], q[i, 1]
        _add_row_products(p[i, 0], p[i, 1], 1.0, u, v, u, v, 1.0, N, right)
    _mirror(N)
    least = _solve(N, right)
    for k in range(8):
        H[k // 3, k % 3] = right[k]
    H[2, 2] = 1.0
    return least


@njit(cache=True, nogil=True, error_model="numpy")
def _normalise(matrix, px, py, ps, qx, qy, qs, H):  # type: ignore[no-untyped-def]
    """The homography between the centred points into `H`."""
    for j in range(3):
        H[0, j] = (matrix[0, j] - qx * matrix[2, j]) / qs
        H[1, j] = (matrix[1, j] - qy * matrix[2, j]) / qs
        H[2, j] = matrix[2, j]
    for i in range(3):
        H[i, 2] += H[i, 0] * px + H[i, 1] * py
        H[i, 0] *= ps
        H[i, 1] *= ps
    H /= H[2, 2]


@njit(cache=True, nogil=True, error_model="numpy")
def _robust_weights(H, p, q, w, good, least, N, right):  # type: ignore[no-untyped-def]
    """Cauchy's fit from `H` on; which corners are good, and (M,) weights of those alone."""
    m = len(p)
    square, counted = np.empty(m), np.empty(m)
    for _ in range(20):
        spread = 2.385 * max(_squares(H, p, q, w, square), 1e-12)
        for i in range(m):
            counted[i] = w[i] / (1.0 + square[i] / (spread * spread))
        if _step(H, p, q, counted, N, right) < _NEAR_ENOUGH:
            break
    sigma = max(_squares(H, p, q, w, square), least)
    for i in range(m):
        good[i] = square[i] <= (OUTLIER_SIGMA * sigma) ** 2
        counted[i] = w[i] if good[i] else 0.0
    return counted


@njit(cache=True, nogil=True, error_model="numpy")
def _fit(plane, image, w, matrix, good, given):  # type: ignore[no-untyped-def]
    """Robust, then plain least squares in normalised coordinates; false where no start is found.

    `matrix` holds the result, and the start where it is `given`; `good` the corners that count.
    A robust fit only tells the wrong corners, so it need not be at its very end.
    """
    m = len(plane)
    p, q = np.empty((m, 2)), np.empty((m, 2))
    px, py, ps = _centred(plane, p)
    qx, qy, qs = _centred(image, q)
    H, N, right = np.empty((3, 3)), np.empty((8, 8)), np.empty(8)
    if given:
        _normalise(matrix, px, py, ps, qx, qy, qs, H)
    elif not _linear(p, q, H, N, right) > _WELL_POSED:
        return False
    counted = _robust_weights(H, p, q, w, good, 1e-9 / qs, N, right)
    for _ in range(6):
        if _step(H, p, q, counted, N, right) < 1e-12:
            break
    for i in range(3):
        H[i, 0] /= ps
        H[i, 1] /= ps
        H[i, 2] -= H[i, 0] * px + H[i, 1] * py
    for j in range(3):
        matrix[0, j] = qs * H[0, j] + qx * H[2, j]
        matrix[1, j] = qs * H[1, j] + qy * H[2, j]
        matrix[2, j] = H[2, j]
    matrix /= matrix[2, 2]
    return True
