"""Plane-to-image homographies: normalised linear start, then least squares in pixels.

The paper's Eq. 19 has the wrong sign in its third block (its null vector is the homography with
the third row negated) and states 12 unknowns where a 3x3 matrix has 9; both are corrected here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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

_DIAGONAL = np.arange(8)


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
    seen: BoolArray = np.asarray(np.isfinite(image_px).all(axis=1))
    if seen.sum() < 5:
        raise CalibrationError(f"a homography with an error needs 5 corners, {seen.sum()} seen")
    weight = _relative_weights(sigma_px, seen)
    p, q, w = plane_m[seen], image_px[seen], weight[seen]
    start = linear_homography(p, q)
    robust = _refine(start, p, q, w, robust=True)
    distance = np.linalg.norm(q - apply_homography(robust, p), axis=1) * np.sqrt(w)
    good = distance <= OUTLIER_SIGMA * max(_scale(distance), 1e-9)
    matrix = _refine(robust, p[good], q[good], w[good], robust=False)
    return _with_errors(matrix, plane_m, image_px, weight, seen, good)


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
    used = residual[inlier] * np.sqrt(weight[inlier])[:, None]
    freedom = max(used.size - 8, 1)
    variance = float((used**2).sum() / freedom)
    J = _jacobian(matrix, plane_m[inlier]) * np.repeat(np.sqrt(weight[inlier]), 2)[:, None]
    scale = np.linalg.norm(J, axis=0)
    covariance = variance * np.linalg.inv((J / scale).T @ (J / scale)) / np.outer(scale, scale)
    return Homography(matrix, covariance, inlier, residual, float(np.sqrt(variance)))


def _relative_weights(sigma_px: FloatArray | None, seen: BoolArray) -> FloatArray:
    if sigma_px is None or not np.isfinite(sigma_px[seen]).all():
        return np.ones(len(seen))
    weight = np.where(seen, 1 / np.where(seen, sigma_px, 1.0) ** 2, 0.0)
    return np.asarray(weight / weight[seen].mean())


def _scale(distance: FloatArray) -> float:
    return float(np.median(distance)) / _RAYLEIGH_MEDIAN


def _normaliser(points: FloatArray) -> FloatArray:
    centre = points.mean(axis=0)
    spread = np.sqrt(((points - centre) ** 2).sum(axis=1).mean() / 2)
    if not spread > 0:
        raise CalibrationError("all corners seen coincide and fix no homography")
    return np.array(
        [[1 / spread, 0, -centre[0] / spread], [0, 1 / spread, -centre[1] / spread], [0, 0, 1]]
    )


def _jacobian(matrix: FloatArray, plane_m: FloatArray) -> FloatArray:
    """(2M, 8) derivative of the image points by the first eight elements."""
    ones = np.column_stack([plane_m, np.ones(len(plane_m))])
    depth = ones @ matrix[2]
    image = (ones @ matrix[:2].T) / depth[:, None]
    J = np.zeros((len(plane_m), 2, 8))
    J[:, 0, :3] = J[:, 1, 3:6] = ones / depth[:, None]
    J[:, :, 6:] = -image[:, :, None] * plane_m[:, None, :] / depth[:, None, None]
    return J.reshape(-1, 8)


def _refine(
    start: FloatArray, p: FloatArray, q: FloatArray, w: FloatArray, *, robust: bool
) -> FloatArray:
    """Gauss-Newton in normalised coordinates; the linear start is within its basin.

    A robust fit only tells the wrong corners, so it need not be at its very end.
    """
    to_plane, to_image = _normaliser(p), _normaliser(q)
    pn, qn = apply_homography(to_plane, p), apply_homography(to_image, q)
    H = to_image @ start @ np.linalg.inv(to_plane)
    H = H / H[2, 2]
    ones = np.column_stack([pn, np.ones(len(pn))])
    products = (ones[:, :, None] * ones[:, None, :]).reshape(-1, 9)
    for _ in range(20 if robust else 6):
        mapped = ones @ H.T
        image = mapped[:, :2] / mapped[:, 2:]
        r = qn - image
        weight = w * _cauchy(r, w) if robust else w
        step = _step(ones, products, mapped[:, 2], image, r, weight)
        H = H + np.append(step, 0.0).reshape(3, 3)
        if np.abs(step).max() < (_NEAR_ENOUGH if robust else 1e-12):
            break
    matrix = np.linalg.inv(to_image) @ H @ to_plane
    return np.asarray(matrix / matrix[2, 2])


def _cauchy(r: FloatArray, w: FloatArray) -> FloatArray:
    """(M,) robust weights of residuals, by their own spread."""
    square = (r**2).sum(axis=1) * w
    spread = 2.385 * np.sqrt(np.median(square)) / _RAYLEIGH_MEDIAN
    return np.asarray(1 / (1 + square / max(spread, 1e-12) ** 2))


def _step(
    ones: FloatArray,
    products: FloatArray,
    depth: FloatArray,
    image: FloatArray,
    r: FloatArray,
    weight: FloatArray,
) -> FloatArray:
    """(8,) Gauss-Newton step from the normal equations, written block by block.

    A row of `_jacobian` is (a, 0, -u p) or (0, a, -v p) over the depth, with a = (x, y, 1) and
    p = (x, y): all its products are sums of the nine products of a.
    """
    u, v = image[:, 0], image[:, 1]
    each = weight / depth
    square = each / depth
    sums = np.stack([square, -u * square, -v * square, (u * u + v * v) * square]) @ products
    plain, by_u, by_v, both = sums.reshape(4, 3, 3)
    N = np.zeros((8, 8))
    N[:3, :3] = N[3:6, 3:6] = plain
    N[:3, 6:], N[3:6, 6:] = by_u[:, :2], by_v[:, :2]
    N[6:, :3], N[6:, 3:6] = by_u[:2], by_v[:2]
    N[6:, 6:] = both[:2, :2]
    ru, rv = each * r[:, 0], each * r[:, 1]
    right = np.stack([ru, rv, -u * ru - v * rv]) @ ones
    N[_DIAGONAL, _DIAGONAL] += _DAMPING * N.trace()
    return np.linalg.solve(N, np.concatenate([right[0], right[1], right[2, :2]]))
