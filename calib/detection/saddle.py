"""The maximum-likelihood fit of one chessboard corner: two blurred edges that cross.

A pixel near a corner is modelled as

    I = m + C E(d1) E(d2),    d_k = n_k . (p - c) - kappa_k t_k^2 / 2

with c the corner, n_k the normals of its two edges, kappa_k their (given) curvature and E the
profile of a blurred edge: erf(d / (sqrt(2) s)) for a Gaussian blur s. Seven parameters are
free: c, the two edge angles, s, C, m; the mean and the contrast may carry a given gradient.
Minimising the squared residual is maximum likelihood for white Gaussian noise, so
sigma^2 (J^T J)^-1 is the covariance of the corner.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

PARAMETERS = 7
X, Y, ANGLE_1, ANGLE_2, WIDTH, CONTRAST, MEAN = range(PARAMETERS)
PIXEL_VARIANCE = 1.0 / 12.0
"""Variance of a pixel's own box, in px^2: what the sensor adds to the blur."""

# below this width a pixel's box no longer passes for a Gaussian (residual above 1e-3 of C)
_BOX_BELOW_PX = 0.75
_SMALLEST_WIDTH_PX = 0.05
_ROOT_2 = math.sqrt(2.0)
_ROOT_2PI = math.sqrt(2.0 * math.pi)

_kernel = numba.njit(cache=True, fastmath=True, error_model="numpy")


@_kernel
def _once_integrated(z: float, s: float) -> float:
    return float(
        z * math.erf(z / (_ROOT_2 * s)) + 2 * s / _ROOT_2PI * math.exp(-0.5 * (z / s) ** 2)
    )


@_kernel
def _twice_integrated(z: float, s: float) -> float:
    bell = math.exp(-0.5 * (z / s) ** 2)
    return float(0.5 * (z * z + s * s) * math.erf(z / (_ROOT_2 * s)) + z * s / _ROOT_2PI * bell)


@_kernel
def _gaussian_edge(d: float, s: float) -> tuple[float, float, float]:
    z = d / s
    if abs(z) > 6.0:
        return (1.0 if d > 0 else -1.0), 0.0, 0.0
    slope = 2.0 / (_ROOT_2PI * s) * math.exp(-0.5 * z * z)
    return math.erf(z / _ROOT_2), slope, -z * slope


@_kernel
def _boxed_edge(d: float, s: float, nx: float, ny: float) -> tuple[float, float, float]:
    """A Gaussian edge averaged over the pixel's square: two boxes, |nx| and |ny| wide."""
    a, b = max(abs(nx), abs(ny)), min(abs(nx), abs(ny))
    if abs(d) > 0.5 * (a + b) + 6.0 * s:
        return (1.0 if d > 0 else -1.0), 0.0, 0.0
    if b < 0.01:
        up, down = d + 0.5 * a, d - 0.5 * a
        value = (_once_integrated(up, s) - _once_integrated(down, s)) / a
        slope = (math.erf(up / (_ROOT_2 * s)) - math.erf(down / (_ROOT_2 * s))) / a
        bells = math.exp(-0.5 * (up / s) ** 2) - math.exp(-0.5 * (down / s) ** 2)
        return value, slope, 2.0 / _ROOT_2PI * bells / a
    value, slope, widening = 0.0, 0.0, 0.0
    for k in range(4):
        z = d + 0.5 * (a if k < 2 else -a) + 0.5 * (b if k % 2 == 0 else -b)
        sign = 1.0 if k == 0 or k == 3 else -1.0
        value += sign * _twice_integrated(z, s)
        slope += sign * _once_integrated(z, s)
        widening += sign * math.erf(z / (_ROOT_2 * s))
    # the heat equation: a Gaussian widens by s times its second derivative
    return value / (a * b), slope / (a * b), s * widening / (a * b)


@_kernel
def _edge(d: float, s: float, nx: float, ny: float, spacing: float) -> tuple[float, float, float]:
    """The edge's profile, its slope, and its derivative by the width.

    The neighbouring parallel edges, `spacing` away on both sides, are taken along where the
    blur reaches them.
    """
    if s < _BOX_BELOW_PX:
        return _boxed_edge(d, math.sqrt(max(s * s - PIXEL_VARIANCE, _SMALLEST_WIDTH_PX**2)), nx, ny)
    value, slope, widening = _gaussian_edge(d, s)
    if spacing < 10.0 * s:
        for side in (-1.0, 1.0):
            far, far_slope, far_widening = _gaussian_edge(d + side * spacing, s)
            value -= far
            slope -= far_slope
            widening -= far_widening
    return value, slope, widening


@_kernel
def _solve_damped(A: Any, g: Any, damping: float, step: Any) -> bool:
    """Cholesky solution of (A + damping diag A) step = g; False where A is not positive."""
    n = g.shape[0]
    L = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j] * (1.0 + damping) if i == j else A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if total <= 1e-12 * abs(A[i, i]) or total <= 0.0:
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    for i in range(n):
        total = g[i]
        for k in range(i):
            total -= L[i, k] * step[k]
        step[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, n):
            total -= L[k, i] * step[k]
        step[i] = total / L[i, i]
    return True


@_kernel
def _gather(image: Any, p: Any, steps: Any, reach: float, xs: Any, ys: Any, values: Any) -> int:
    """Collect the window's pixels: all near the edges, every third of the flat squares.

    The window is the parallelogram of the lattice: |a|, |b| <= reach with p - c = a e1 + b e2.
    """
    ax, ay, bx, by = steps
    det = ax * by - ay * bx
    half_w, half_h = reach * (abs(ax) + abs(bx)), reach * (abs(ay) + abs(by))
    length_a, length_b = math.hypot(ax, ay), math.hypot(bx, by)
    strip = 3.5 * p[WIDTH] + 1.5
    height, width = image.shape
    count = 0
    for iy in range(max(0, int(p[Y] - half_h)), min(height - 1, int(p[Y] + half_h) + 1) + 1):
        for ix in range(max(0, int(p[X] - half_w)), min(width - 1, int(p[X] + half_w) + 1) + 1):
            dx, dy = ix - p[X], iy - p[Y]
            a, b = (dx * by - dy * bx) / det, (ax * dy - ay * dx) / det
            if abs(a) > reach or abs(b) > reach:
                continue
            near = min(abs(b * det) / length_a, abs(a * det) / length_b)
            if (near < strip or (ix + iy) % 3 == 0) and count < xs.shape[0]:
                xs[count], ys[count], values[count] = ix, iy, image[iy, ix]
                count += 1
    return count


@_kernel
def _normal_equations(
    p: Any, xs: Any, ys: Any, values: Any, count: int, shape: Any, A: Any, g: Any
) -> float:
    """Fill A = J^T J and g = J^T r; the sum of squared residuals is returned.

    `shape` holds the given (not fitted) terms: gradients of mean and contrast (4), curvatures
    of the two edges (2), distances to the parallel neighbours of the two edges (2).
    """
    A[:] = 0.0
    g[:] = 0.0
    J = np.empty(PARAMETERS)
    t1x, t1y = math.cos(p[ANGLE_1]), math.sin(p[ANGLE_1])
    t2x, t2y = math.cos(p[ANGLE_2]), math.sin(p[ANGLE_2])
    cost = 0.0
    for i in range(count):
        dx, dy = xs[i] - p[X], ys[i] - p[Y]
        along1, along2 = t1x * dx + t1y * dy, t2x * dx + t2y * dy
        d1 = -t1y * dx + t1x * dy - 0.5 * shape[4] * along1 * along1
        d2 = -t2y * dx + t2x * dy - 0.5 * shape[5] * along2 * along2
        e1, slope1, widening1 = _edge(d1, p[WIDTH], t1y, t1x, shape[6])
        e2, slope2, widening2 = _edge(d2, p[WIDTH], t2y, t2x, shape[7])
        contrast = p[CONTRAST] + shape[2] * dx + shape[3] * dy
        residual = values[i] - p[MEAN] - shape[0] * dx - shape[1] * dy - contrast * e1 * e2
        k1, k2 = contrast * slope1 * e2, contrast * slope2 * e1
        J[X] = k1 * t1y + k2 * t2y
        J[Y] = -k1 * t1x - k2 * t2x
        J[ANGLE_1] = -k1 * along1
        J[ANGLE_2] = -k2 * along2
        J[WIDTH] = contrast * (widening1 * e2 + widening2 * e1)
        J[CONTRAST] = e1 * e2
        J[MEAN] = 1.0
        cost += residual * residual
        for r in range(PARAMETERS):
            g[r] += J[r] * residual
            for c in range(r + 1):
                A[r, c] += J[r] * J[c]
    return cost


@_kernel
def _minimise(
    p: Any, xs: Any, ys: Any, values: Any, count: int, shape: Any, A: Any, iterations: int
) -> float:
    """Levenberg-Marquardt from p, in place; the cost, or -1 where it breaks down."""
    g, trial, step = np.empty(PARAMETERS), np.empty(PARAMETERS), np.empty(PARAMETERS)
    A_trial, g_trial = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS)
    cost = _normal_equations(p, xs, ys, values, count, shape, A, g)
    damping = 1e-3
    for _ in range(iterations):
        if not _solve_damped(A, g, damping, step):
            return -1.0
        trial[:] = p + step
        trial[WIDTH] = min(max(trial[WIDTH], 0.5 * p[WIDTH], 0.29), 2.0 * p[WIDTH])
        new = _normal_equations(trial, xs, ys, values, count, shape, A_trial, g_trial)
        moved = abs(step[X]) + abs(step[Y])
        if new <= cost:
            p[:], A[:], g[:] = trial, A_trial, g_trial
            cost, damping = new, damping * 0.1
            if moved < 1e-4:
                break
        else:
            damping = max(damping, 1e-4) * 10.0
            if moved < 1e-5 or damping > 1e4:
                break
    return cost


@numba.njit(cache=True)
def _fit(
    image: Any, starts: Any, steps: Any, shapes: Any, reach_px: float, reach: float, iterations: int
) -> tuple[Any, Any, Any]:
    M = starts.shape[0]
    fitted = starts.copy()
    covariance = np.full((M, 2, 2), np.nan)
    residual = np.full(M, np.nan)
    A, step, unit = np.empty((7, 7)), np.empty(7), np.empty(7)
    capacity = int((4.0 * reach_px + 8.0) ** 2)
    xs, ys, values = np.empty(capacity), np.empty(capacity), np.empty(capacity)
    for i in range(M):
        p = fitted[i]
        longest = max(math.hypot(steps[i, 0], steps[i, 1]), math.hypot(steps[i, 2], steps[i, 3]))
        count = _gather(image, p, steps[i], min(reach, reach_px / longest), xs, ys, values)
        if count <= PARAMETERS + 4:
            continue
        cost = _minimise(p, xs, ys, values, count, shapes[i], A, iterations)
        if cost < 0.0 or not math.isfinite(cost):
            continue
        variance = cost / (count - PARAMETERS)
        for axis in range(2):
            unit[:] = 0.0
            unit[axis] = 1.0
            if _solve_damped(A, unit, 0.0, step):
                covariance[i, 0, axis], covariance[i, 1, axis] = (
                    variance * step[0],
                    variance * step[1],
                )
                residual[i] = math.sqrt(variance)
    return fitted, covariance, residual


def fit_corners(
    image: NDArray[np.float32],
    starts: NDArray[np.float64],
    steps: NDArray[np.float64],
    shapes: NDArray[np.float64],
    *,
    reach: float = 0.4,
    reach_px: float = 40.0,
    iterations: int = 12,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Fit every corner from its start.

    Parameters
    ----------
    image:
        (h, w) grey levels.
    starts:
        (M, 7) x and y in pixels, angles of the two edges in radians, edge width (blur and
        pixel together, Gaussian sigma) in pixels, contrast (half the step, signed), mean.
    steps:
        (M, 4) lattice steps e1 and e2 at the corner, pixels; edge 1 runs along e1.
    shapes:
        (M, 8) given terms: gradient of mean (2) and contrast (2) in grey levels per pixel,
        curvature of the edges (2) in 1/pixel, distance of each edge's parallel neighbours (2).
    reach, reach_px:
        The window's half side as a share of the lattice step, and its limit in pixels.
    iterations:
        Most Levenberg-Marquardt steps.

    Returns
    -------
    (M, 7) fitted parameters, (M, 2, 2) covariance of x and y in px^2, (M,) standard deviation
    of the residual in grey levels. Where the fit broke down the latter two are NaN.
    """
    fitted, covariance, residual = _fit(image, starts, steps, shapes, reach_px, reach, iterations)
    return fitted, covariance, residual
