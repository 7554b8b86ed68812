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
FEWEST = 5
"""Corners with which a homography has an error."""
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


def robust_homographies(
    plane_m: FloatArray, images_px: FloatArray
) -> tuple[FloatArray, BoolArray, dict[int, str]]:
    """Matrices and inliers of `fit_homography` alone, for many pictures of one plane.

    Parameters
    ----------
    plane_m:
        (M, 2) points on the plane, metres.
    images_px:
        (N, M, 2) their images; NaN where one was not seen.

    Returns
    -------
    (N, 3, 3) image_from_plane, NaN where a picture fixes none; (N, M) the corners used; and why
    a picture fixes none, by its place.
    """
    matrices = np.full((len(images_px), 3, 3), np.nan)
    good: BoolArray = np.asarray(np.isfinite(images_px).all(axis=2))
    hard = np.zeros(len(images_px), dtype=np.bool_)
    _fit_all(np.ascontiguousarray(plane_m), np.ascontiguousarray(images_px), matrices, good, hard)
    failed = {}
    for i in np.flatnonzero(hard):
        seen = good[i].copy()
        try:
            _enough(images_px[i])
            matrices[i], good[i, seen] = _robust(
                plane_m[seen], images_px[i, seen], np.ones(np.count_nonzero(seen))
            )
        except CalibrationError as error:
            good[i], failed[int(i)] = False, str(error)
    return matrices, good, failed


def _enough(image_px: FloatArray) -> BoolArray:
    seen: BoolArray = np.asarray(np.isfinite(image_px).all(axis=1))
    count = np.count_nonzero(seen)
    if count < FEWEST:
        raise CalibrationError(f"a homography with an error needs {FEWEST} corners, {count} seen")
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
    p, q = np.ascontiguousarray(plane_m[inlier].T), np.ascontiguousarray(image_px[inlier].T)
    _normal_equations(matrix, p, q, counted, N, unused, np.empty((5, len(counted))))
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


_SUMS = {"reassoc", "contract", "nsz"}
"""Sums may be taken in another order, so that they go several corners at a time."""


@njit(cache=True, nogil=True, error_model="numpy")
def _mirror(N):  # type: ignore[no-untyped-def]
    """Fill the second diagonal block and the lower triangle."""
    for i in range(3):
        for j in range(i, 3):
            N[3 + i, 3 + j] = N[i, j]
    for i in range(8):
        for j in range(i):
            N[i, j] = N[j, i]


# Each loop is one run of sums, few enough to stay in the processor's registers.
@njit(cache=True, nogil=True, error_model="numpy", fastmath=_SUMS)
def _add_products(x, y, depth, u, v, w, N):  # type: ignore[no-untyped-def]
    """Products of the rows (a, 0, -u p) and (0, a, -v p) over the depth.

    a = (x, y, 1), p = (x, y): the derivative of a corner's image by the first eight elements.
    """
    xx = xy = yy = x1 = y1 = one = 0.0
    uxx = uxy = uyy = ux = uy = 0.0
    for i in range(len(x)):
        c = w[i] / (depth[i] * depth[i])
        cx, cy, cu = c * x[i], c * y[i], c * u[i]
        cux, cuy = cu * x[i], cu * y[i]
        xx += cx * x[i]
        xy += cx * y[i]
        yy += cy * y[i]
        x1 += cx
        y1 += cy
        one += c
        uxx += cux * x[i]
        uxy += cux * y[i]
        uyy += cuy * y[i]
        ux += cux
        uy += cuy
    vxx = vxy = vyy = vx = vy = sxx = sxy = syy = 0.0
    for i in range(len(x)):
        c = w[i] / (depth[i] * depth[i])
        cv, cs = c * v[i], c * (u[i] * u[i] + v[i] * v[i])
        cvx, cvy, csx = cv * x[i], cv * y[i], cs * x[i]
        vxx += cvx * x[i]
        vxy += cvx * y[i]
        vyy += cvy * y[i]
        vx += cvx
        vy += cvy
        sxx += csx * x[i]
        sxy += csx * y[i]
        syy += cs * y[i] * y[i]
    N[0, 0], N[0, 1], N[0, 2], N[1, 1], N[1, 2], N[2, 2] = xx, xy, x1, yy, y1, one
    N[0, 6], N[0, 7], N[1, 6], N[1, 7], N[2, 6], N[2, 7] = -uxx, -uxy, -uxy, -uyy, -ux, -uy
    N[3, 6], N[3, 7], N[4, 6], N[4, 7], N[5, 6], N[5, 7] = -vxx, -vxy, -vxy, -vyy, -vx, -vy
    N[6, 6], N[6, 7], N[7, 7] = sxx, sxy, syy
    N[0:3, 3:6] = 0.0
    _mirror(N)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_SUMS)
def _add_misses(x, y, depth, u, v, ru, rv, w, right):  # type: ignore[no-untyped-def]
    """Products of the rows with how far the corners are off, (ru, rv)."""
    r0 = r1 = r2 = r3 = r4 = r5 = r6 = r7 = 0.0
    for i in range(len(x)):
        c = w[i] / depth[i]
        cu, cv = c * ru[i], c * rv[i]
        both = u[i] * cu + v[i] * cv
        r0 += cu * x[i]
        r1 += cu * y[i]
        r2 += cu
        r3 += cv * x[i]
        r4 += cv * y[i]
        r5 += cv
        r6 += both * x[i]
        r7 += both * y[i]
    right[0], right[1], right[2], right[3], right[4], right[5] = r0, r1, r2, r3, r4, r5
    right[6], right[7] = -r6, -r7


@njit(cache=True, nogil=True, error_model="numpy")
def _map(H, x, y, qu, qv, rows):  # type: ignore[no-untyped-def]
    """Depth, image and how far the seen one is off it, into the five rows."""
    h00, h01, h02, h10, h11, h12 = H[0, 0], H[0, 1], H[0, 2], H[1, 0], H[1, 1], H[1, 2]
    h20, h21, h22 = H[2, 0], H[2, 1], H[2, 2]
    depth, u, v, ru, rv = rows[0], rows[1], rows[2], rows[3], rows[4]
    for i in range(len(x)):
        depth[i] = h20 * x[i] + h21 * y[i] + h22
    for i in range(len(x)):
        u[i] = (h00 * x[i] + h01 * y[i] + h02) / depth[i]
        ru[i] = qu[i] - u[i]
    for i in range(len(x)):
        v[i] = (h10 * x[i] + h11 * y[i] + h12) / depth[i]
        rv[i] = qv[i] - v[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _normal_equations(H, p, q, w, N, right, rows):  # type: ignore[no-untyped-def]
    """Gauss-Newton equations of (2, M) points at H, into (8, 8) and (8,); `rows` is (5, M)."""
    _map(H, p[0], p[1], q[0], q[1], rows)
    _add_products(p[0], p[1], rows[0], rows[1], rows[2], w, N)
    _add_misses(p[0], p[1], rows[0], rows[1], rows[2], rows[3], rows[4], w, right)


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
    """(M, 2) points about their centre, of unit spread, into (2, M); centre and spread."""
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
        out[0, i] = (points[i, 0] - cx) / spread
        out[1, i] = (points[i, 1] - cy) / spread
    return cx, cy, spread


@njit(cache=True, nogil=True, error_model="numpy")
def _squares(H, p, q, w, out, rows):  # type: ignore[no-untyped-def]
    """(M,) weighted squared distances into `out`; their robust one-sigma per axis."""
    _map(H, p[0], p[1], q[0], q[1], rows)
    ru, rv = rows[3], rows[4]
    for i in range(len(out)):
        out[i] = w[i] * (ru[i] * ru[i] + rv[i] * rv[i])
    return math.sqrt(np.median(out)) / _RAYLEIGH_MEDIAN


@njit(cache=True, nogil=True, error_model="numpy")
def _take_step(H, N, right):  # type: ignore[no-untyped-def]
    """Solve, and put the step on H; its largest element."""
    _solve(N, right)
    largest = 0.0
    for k in range(8):
        H[k // 3, k % 3] += right[k]
        largest = max(largest, abs(right[k]))
    return largest


@njit(cache=True, nogil=True, error_model="numpy")
def _step(H, p, q, w, N, right, rows):  # type: ignore[no-untyped-def]
    """One Gauss-Newton step; its largest element."""
    _normal_equations(H, p, q, w, N, right, rows)
    return _take_step(H, N, right)


@njit(cache=True, nogil=True, error_model="numpy")
def _linear(p, q, H, N, right):  # type: ignore[no-untyped-def]
    """Direct linear transform by normal equations; the least pivot, as `_solve`."""
    one = np.ones(p.shape[1])
    _add_products(p[0], p[1], one, q[0], q[1], one, N)
    _add_misses(p[0], p[1], one, q[0], q[1], q[0], q[1], one, right)
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
def _robust_weights(H, p, q, w, good, least, N, right, rows):  # type: ignore[no-untyped-def]
    """Cauchy's fit from `H` on; which corners are good, and (M,) weights of those alone."""
    m = len(w)
    square, counted = np.empty(m), np.empty(m)
    for _ in range(20):
        # the squares leave in `rows` what the equations at the same place need
        spread = 2.385 * max(_squares(H, p, q, w, square, rows), 1e-12)
        per = 1.0 / (spread * spread)
        for i in range(m):
            counted[i] = w[i] / (1.0 + square[i] * per)
        _add_products(p[0], p[1], rows[0], rows[1], rows[2], counted, N)
        _add_misses(p[0], p[1], rows[0], rows[1], rows[2], rows[3], rows[4], counted, right)
        if _take_step(H, N, right) < _NEAR_ENOUGH:
            break
    sigma = max(_squares(H, p, q, w, square, rows), least)
    for i in range(m):
        good[i] = square[i] <= (OUTLIER_SIGMA * sigma) ** 2
        counted[i] = w[i] if good[i] else 0.0
    return counted


@njit(cache=True, nogil=True, error_model="numpy")
def _fit(plane, image, w, matrix, good, given):  # type: ignore[no-untyped-def]
    """Robust, then plain least squares in normalised coordinates; false where no start is found.

    `matrix` holds the result, and the start where it is `given`; `good` the corners that count.
    A robust fit only finds the wrong corners, so it need not be at its very end.
    """
    m = len(plane)
    p, q, rows = np.empty((2, m)), np.empty((2, m)), np.empty((5, m))
    px, py, ps = _centred(plane, p)
    qx, qy, qs = _centred(image, q)
    H, N, right = np.empty((3, 3)), np.empty((8, 8)), np.empty(8)
    if given:
        _normalise(matrix, px, py, ps, qx, qy, qs, H)
    elif not _linear(p, q, H, N, right) > _WELL_POSED:
        return False
    counted = _robust_weights(H, p, q, w, good, 1e-9 / qs, N, right, rows)
    for _ in range(6):
        if _step(H, p, q, counted, N, right, rows) < 1e-12:
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


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_all(plane, images, matrices, good, hard):  # type: ignore[no-untyped-def]
    """`_fit` of each picture's seen corners; `hard` where it needs a better start.

    `good` holds the corners seen, and of a picture that was fitted those that count.
    """
    m = len(plane)
    p, q, w, kept = np.empty((m, 2)), np.empty((m, 2)), np.ones(m), np.ones(m, np.bool_)
    for i in range(len(images)):
        count = 0
        for j in range(m):
            if good[i, j]:
                p[count], q[count] = plane[j], images[i, j]
                count += 1
        fits = count >= FEWEST and _fit(
            p[:count], q[:count], w[:count], matrices[i], kept[:count], False
        )
        if not fits:
            hard[i] = True
            matrices[i] = np.nan
            continue
        count = 0
        for j in range(m):
            if good[i, j]:
                good[i, j] = kept[count]
                count += 1
