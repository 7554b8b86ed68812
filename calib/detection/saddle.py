"""The maximum-likelihood fit of one chessboard corner: two blurred edges that cross.

A pixel near a corner is modelled as

    I = m + C (E(d1) E(d2) + R(d1, d2)),    d_k = n_k . (p - c) - kappa_k t_k^2 / 2

with c the corner, n_k the normals of its two edges, kappa_k their (given) curvature and E the
profile of a blurred edge: erf(d / (sqrt(2) s)) for a Gaussian blur s. R is what edges that do
not cross at right angles add. Seven parameters are
free: c, the two edge angles, s, C, m; the mean and the contrast may carry a given gradient.
Minimising the squared residual is maximum likelihood for white Gaussian noise, so
sigma^2 (J^T J)^-1 is the covariance of the corner.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

PARAMETERS = 7
X, Y, ANGLE_1, ANGLE_2, WIDTH, CONTRAST, MEAN = range(PARAMETERS)
PIXEL_VARIANCE = 1.0 / 12.0
"""Variance of a pixel's own box, in px^2: what the sensor adds to the blur."""

NO_MARKS = np.zeros((0, 0), np.float32)

# below this width a pixel's box no longer passes for a Gaussian (residual above 1e-3 of C)
_BOX_BELOW_PX = 0.75
_SMALLEST_WIDTH_PX = 0.05
# edges farther away than this many blur widths change nothing (4e-3 of C)
_REACH_OF_BLUR = 2.9
# the next step would be a few percent of this one
_CONVERGED_PX = 2e-3
_ROOT_2 = math.sqrt(2.0)
_ROOT_2PI = math.sqrt(2.0 * math.pi)
_NODES, _WEIGHTS = (0.5 * (part + shift) for part, shift in zip(leggauss(4), (1, 0), strict=True))

_kernel = numba.njit(cache=True, fastmath=True, error_model="numpy")


@_kernel
def _erf_and_bell(z: float) -> tuple[float, float]:
    """erf(z / sqrt(2)) to 1.5e-7 (Abramowitz and Stegun 7.1.26), and exp(-z^2 / 2)."""
    bell = math.exp(-0.5 * z * z)
    t = 1.0 / (1.0 + 0.3275911 / _ROOT_2 * abs(z))
    tail = t * (
        0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429)))
    )
    value = 1.0 - tail * bell
    return (value if z >= 0 else -value), bell


@_kernel
def _gaussian_edge(d: float, s: float) -> tuple[float, float, float]:
    z = d / s
    if abs(z) > 5.0:
        return (1.0 if d > 0 else -1.0), 0.0, 0.0
    value, bell = _erf_and_bell(z)
    slope = 2.0 / (_ROOT_2PI * s) * bell
    return value, slope, -z * slope


@_kernel
def _boxed_edge(d: float, s: float, nx: float, ny: float) -> tuple[float, float, float]:
    """A Gaussian edge averaged over the pixel's square: two boxes, |nx| and |ny| wide.

    Averaging over a box is a difference of antiderivatives; a Gaussian's derivative by its
    width is s times its second derivative (the heat equation).
    """
    a, b = max(abs(nx), abs(ny)), min(abs(nx), abs(ny))
    if abs(d) > 0.5 * (a + b) + 5.0 * s:
        return (1.0 if d > 0 else -1.0), 0.0, 0.0
    if b < 0.03:
        up, down = d + 0.5 * a, d - 0.5 * a
        erf_up, bell_up = _erf_and_bell(up / s)
        erf_down, bell_down = _erf_and_bell(down / s)
        bells = 2.0 / _ROOT_2PI * (bell_up - bell_down) / a
        return (up * erf_up - down * erf_down) / a + s * bells, (erf_up - erf_down) / a, bells
    value, slope, widening = 0.0, 0.0, 0.0
    for k in range(4):
        z = d + 0.5 * (a if k < 2 else -a) + 0.5 * (b if k % 2 == 0 else -b)
        sign = 1.0 if k == 0 or k == 3 else -1.0
        erf, bell = _erf_and_bell(z / s)
        value += sign * (0.5 * (z * z + s * s) * erf + z * s / _ROOT_2PI * bell)
        slope += sign * (z * erf + 2.0 * s / _ROOT_2PI * bell)
        widening += sign * erf
    return value / (a * b), slope / (a * b), s * widening / (a * b)


@_kernel
def _edge(d: float, s: float, nx: float, ny: float) -> tuple[float, float, float]:
    """The edge's profile, its slope, and its derivative by the width."""
    if s < _BOX_BELOW_PX:
        blur = math.sqrt(max(s * s - PIXEL_VARIANCE, _SMALLEST_WIDTH_PX**2))
        value, slope, widening = _boxed_edge(d, blur, nx, ny)
        return value, slope, widening * s / blur
    return _gaussian_edge(d, s)


@_kernel
def _slant(z1: float, z2: float, rho: float) -> tuple[float, float, float, float]:
    """What a blurred crossing of slanted edges has beyond the product of their profiles.

    Blurring sgn(d1) sgn(d2) with a round Gaussian gives a bivariate normal integral whose
    correlation is rho = n1 . n2; by Plackett's identity it exceeds the product for rho = 0 by
    4 times the integral of the bivariate density over rho, taken here in arcsin(rho) with four
    Gauss-Legendre nodes (Drezner and Wesolowsky 1990).

    Returns
    -------
    The excess and its derivatives by z1 = d1 / s, z2 = d2 / s and rho.
    """
    if abs(rho) < 1e-3 or abs(z1) > 4.0 or abs(z2) > 4.0:
        return 0.0, 0.0, 0.0, 0.0
    q = math.sqrt(1.0 - rho * rho)
    widest = math.asin(rho)
    excess = 0.0
    for k in range(4):
        sine = math.sin(widest * _NODES[k])
        power = (z1 * z1 + z2 * z2 - 2.0 * z1 * z2 * sine) / (1.0 - sine * sine)
        excess += _WEIGHTS[k] * math.exp(-0.5 * power)
    erf1, bell1 = _erf_and_bell(z1)
    erf2, bell2 = _erf_and_bell(z2)
    given1, bell_given1 = _erf_and_bell((z2 - rho * z1) / q)
    given2, _ = _erf_and_bell((z1 - rho * z2) / q)
    return (
        2.0 / math.pi * widest * excess,
        2.0 / _ROOT_2PI * bell1 * (given1 - erf2),
        2.0 / _ROOT_2PI * bell2 * (given2 - erf1),
        2.0 / math.pi * bell1 * bell_given1 / q,
    )


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
def _neighbour_edges(x: float, y: float, s: float, lines: Any, first: int) -> tuple[float, float]:
    """What the parallel edges on both sides do to an edge's profile at (x, y).

    `lines[first]` lies on the side of positive d, `lines[first + 1]` on the other; each is
    (nx, ny, offset, inner). Beyond an inner line the colours change places; beyond the rim
    lies the board's bright margin.

    Returns
    -------
    What is added to the profile, and the share that the margin leaves of the pattern.
    """
    added, left = 0.0, 1.0
    for k in range(2):
        inward = 1.0 if k == 1 else -1.0
        line = lines[first + k]
        distance = inward * (line[0] * x + line[1] * y - line[2])
        if distance > _REACH_OF_BLUR * s:
            continue
        beyond = 1.0 - _gaussian_edge(distance, s)[0]
        if line[3] == 0.0:
            left *= 1.0 - 0.5 * beyond
        else:
            added += inward * beyond
    return added, left


@_kernel
def _neighbour_slants(x: float, y: float, p: Any, lines: Any) -> float:
    """What the eight crossings around add where slant and blur are large, see `_slant`."""
    s = p[WIDTH]
    rho = math.cos(p[ANGLE_2] - p[ANGLE_1])
    if abs(rho) < 0.03:
        return 0.0
    z1, z2 = np.empty(3), np.empty(3)
    z1[0] = (math.cos(p[ANGLE_1]) * (y - p[Y]) - math.sin(p[ANGLE_1]) * (x - p[X])) / s
    z2[0] = (math.cos(p[ANGLE_2]) * (y - p[Y]) - math.sin(p[ANGLE_2]) * (x - p[X])) / s
    for k in range(2):
        z1[k + 1] = (lines[k, 0] * x + lines[k, 1] * y - lines[k, 2]) / s
        z2[k + 1] = (lines[k + 2, 0] * x + lines[k + 2, 1] * y - lines[k + 2, 2]) / s
    total = 0.0
    for i in range(3):
        for j in range(3):
            inner = (i == 0 or lines[i - 1, 3] == 1.0) and (j == 0 or lines[j + 1, 3] == 1.0)
            if i + j > 0 and inner and abs(z1[i]) < 3.0 and abs(z2[j]) < 3.0:
                sign = 1.0 if (i == 0) == (j == 0) else -1.0
                total += sign * _slant(z1[i], z2[j], rho)[0]
    return total


@_kernel
def _gather(
    image: Any, marks: Any, p: Any, steps: Any, lines: Any, reach: float, clear: float, pixels: Any
) -> int:
    """Collect the window's pixels: all near the edges, some of the flat squares.

    The window is the parallelogram of the lattice: |a|, |b| <= reach with p - c = a e1 + b e2,
    without the squares' middles, |a| and |b| > clear. A row of `pixels` is x, y, value, what
    neighbouring edges add to the two profiles, the share that the margin leaves of them, and
    what slanted crossings and dark print nearby add to the pattern, and how the latter changes (2)
    as the corner moves and takes the print along.
    """
    ax, ay, bx, by = steps
    det = ax * by - ay * bx
    half_w, half_h = reach * (abs(ax) + abs(bx)), reach * (abs(ay) + abs(by))
    per_a, per_b = abs(det) / math.hypot(bx, by), abs(det) / math.hypot(ax, ay)
    strip = 3.2 * p[WIDTH] + 1.0
    height, width = image.shape
    count = 0
    for iy in range(max(0, int(p[Y] - half_h)), min(height - 1, int(p[Y] + half_h) + 1) + 1):
        for ix in range(max(0, int(p[X] - half_w)), min(width - 1, int(p[X] + half_w) + 1) + 1):
            dx, dy = ix - p[X], iy - p[Y]
            a, b = (dx * by - dy * bx) / det, (ax * dy - ay * dx) / det
            if abs(a) > reach or abs(b) > reach or min(abs(a), abs(b)) > clear:
                continue
            if min(abs(a) * per_a, abs(b) * per_b) > strip and (ix % 3 or iy % 3):
                continue
            if count == pixels.shape[0]:
                return count
            pixels[count, 6] = _neighbour_slants(float(ix), float(iy), p, lines)
            pixels[count, 7] = pixels[count, 8] = 0.0
            if marks.shape[0] > 0:
                double = 2.0 if p[CONTRAST] > 0 else -2.0
                left, right = max(ix - 1, 0), min(ix + 1, width - 1)
                above, below = max(iy - 1, 0), min(iy + 1, height - 1)
                pixels[count, 6] -= double * marks[iy, ix]
                pixels[count, 7] = double * (marks[iy, right] - marks[iy, left]) / (right - left)
                pixels[count, 8] = double * (marks[below, ix] - marks[above, ix]) / (below - above)
            add1, left1 = _neighbour_edges(float(ix), float(iy), p[WIDTH], lines, 0)
            add2, left2 = _neighbour_edges(float(ix), float(iy), p[WIDTH], lines, 2)
            pixels[count, 0], pixels[count, 1], pixels[count, 2] = ix, iy, image[iy, ix]
            pixels[count, 3], pixels[count, 4], pixels[count, 5] = add1, add2, left1 * left2
            count += 1
    return count


@_kernel
def _normal_equations(
    p: Any, pixels: Any, count: int, shape: Any, x0: float, y0: float, A: Any, g: Any
) -> float:
    """Fill A = J^T J and g = J^T r; the sum of squared residuals is returned.

    `shape` holds the given (not fitted) terms: gradients of mean and contrast (4), curvatures
    of the two edges (2). Where the gradients' plane is pinned down moves with the corner; that
    is not in J, since the fitted mean and contrast make it good. The pixels were gathered with the
    corner at (x0, y0).
    """
    A[:] = 0.0
    g[:] = 0.0
    J = np.empty(PARAMETERS)
    t1x, t1y = math.cos(p[ANGLE_1]), math.sin(p[ANGLE_1])
    t2x, t2y = math.cos(p[ANGLE_2]), math.sin(p[ANGLE_2])
    rho, sine = t1x * t2x + t1y * t2y, t1x * t2y - t1y * t2x
    J[MEAN] = 1.0
    margin = 1.0 if p[CONTRAST] > 0 else -1.0
    cost = 0.0
    for i in range(count):
        dx, dy = pixels[i, 0] - p[X], pixels[i, 1] - p[Y]
        along1, along2 = t1x * dx + t1y * dy, t2x * dx + t2y * dy
        d1 = -t1y * dx + t1x * dy - 0.5 * shape[4] * along1 * along1
        d2 = -t2y * dx + t2x * dy - 0.5 * shape[5] * along2 * along2
        e1, slope1, widening1 = _edge(d1, p[WIDTH], t1y, t1x)
        e2, slope2, widening2 = _edge(d2, p[WIDTH], t2y, t2x)
        e1, e2 = e1 + pixels[i, 3], e2 + pixels[i, 4]
        z1, z2 = d1 / p[WIDTH], d2 / p[WIDTH]
        excess, by_z1, by_z2, by_rho = _slant(z1, z2, rho)
        print_x, print_y = pixels[i, 7], pixels[i, 8]
        excess += pixels[i, 6] + print_x * (p[X] - x0) + print_y * (p[Y] - y0)
        left = pixels[i, 5]
        contrast = p[CONTRAST] + shape[2] * dx + shape[3] * dy
        profile = left * (e1 * e2 + excess) + (1.0 - left) * margin
        residual = pixels[i, 2] - p[MEAN] - shape[0] * dx - shape[1] * dy - contrast * profile
        cost += residual * residual
        J[CONTRAST] = profile
        first = CONTRAST
        if slope1 != 0.0 or slope2 != 0.0 or print_x != 0.0 or print_y != 0.0:
            pattern = left * contrast
            k1 = pattern * (slope1 * e2 + by_z1 / p[WIDTH])
            k2 = pattern * (slope2 * e1 + by_z2 / p[WIDTH])
            J[X] = k1 * t1y + k2 * t2y + pattern * print_x
            J[Y] = -k1 * t1x - k2 * t2x + pattern * print_y
            J[ANGLE_1] = -k1 * along1 + pattern * by_rho * sine
            J[ANGLE_2] = -k2 * along2 - pattern * by_rho * sine
            widening = (z1 * by_z1 + z2 * by_z2) / p[WIDTH]
            J[WIDTH] = pattern * (widening1 * e2 + widening2 * e1 - widening)
            first = X
        for r in range(first, PARAMETERS):
            g[r] += J[r] * residual
            for c in range(first, r + 1):
                A[r, c] += J[r] * J[c]
    return cost


@_kernel
def _minimise(p: Any, pixels: Any, count: int, shape: Any, A: Any, iterations: int) -> float:
    """Levenberg-Marquardt from p, in place; the cost, or -1 where it breaks down."""
    g, trial, step = np.empty(PARAMETERS), np.empty(PARAMETERS), np.empty(PARAMETERS)
    A_trial, g_trial = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS)
    x0, y0 = p[X], p[Y]
    cost = _normal_equations(p, pixels, count, shape, x0, y0, A, g)
    damping = 1e-3
    for _ in range(iterations):
        if not _solve_damped(A, g, damping, step):
            return -1.0
        for k in range(PARAMETERS):
            trial[k] = p[k] + step[k]
        trial[WIDTH] = min(max(trial[WIDTH], 0.5 * p[WIDTH], 0.29), 2.0 * p[WIDTH])
        new = _normal_equations(trial, pixels, count, shape, x0, y0, A_trial, g_trial)
        moved = abs(step[X]) + abs(step[Y])
        if new <= cost:
            for k in range(PARAMETERS):
                p[k], g[k] = trial[k], g_trial[k]
                for m in range(k + 1):
                    A[k, m] = A_trial[k, m]
            cost, damping = new, damping * 0.1
            if moved < _CONVERGED_PX:
                break
        else:
            damping = max(damping, 1e-4) * 10.0
            if moved < 1e-5 or damping > 1e4:
                break
    return cost


@numba.njit(cache=True, nogil=True)
def _fit(
    image: Any,
    marks: Any,
    starts: Any,
    steps: Any,
    shapes: Any,
    lines: Any,
    reach_px: float,
    reach: float,
    clear: float,
    iterations: int,
) -> tuple[Any, Any, Any]:
    M = starts.shape[0]
    fitted = starts.copy()
    covariance = np.full((M, 2, 2), np.nan)
    residual = np.full(M, np.nan)
    A, step, unit = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS), np.empty(PARAMETERS)
    pixels = np.empty((int((4.0 * reach_px + 8.0) ** 2), 9))
    for i in range(M):
        p = fitted[i]
        if not math.isfinite(p.sum() + steps[i].sum()):
            continue
        longest = max(math.hypot(steps[i, 0], steps[i, 1]), math.hypot(steps[i, 2], steps[i, 3]))
        share = min(reach, reach_px / longest)
        count = _gather(image, marks, p, steps[i], lines[i], share, clear, pixels)
        if count <= PARAMETERS + 4:
            continue
        cost = _minimise(p, pixels, count, shapes[i], A, iterations)
        if cost < 0.0 or not math.isfinite(cost):
            continue
        variance = cost / (count - PARAMETERS)
        for axis in range(2):
            unit[:] = 0.0
            unit[axis] = 1.0
            if _solve_damped(A, unit, 0.0, step):
                covariance[i, 0, axis] = variance * step[X]
                covariance[i, 1, axis] = variance * step[Y]
                residual[i] = math.sqrt(variance)
    return fitted, covariance, residual


def fit_corners(
    image: NDArray[np.float32],
    starts: NDArray[np.float64],
    steps: NDArray[np.float64],
    shapes: NDArray[np.float64],
    lines: NDArray[np.float64],
    *,
    reach: float = 0.4,
    reach_px: float = 40.0,
    clear: float = 1.0,
    iterations: int = 12,
    marks: NDArray[np.float32] = NO_MARKS,
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
        (M, 6) given terms: gradient of mean (2) and contrast (2) in grey levels per pixel,
        curvature of the edges (2) in 1/pixel.
    lines:
        (M, 4, 4) the parallel neighbours of edge 1 (on the side of its normal, then the other)
        and of edge 2, each as unit normal (2), offset in pixels, and 1 where that is an edge
        between squares, 0 where it is the rim of the board with a bright margin beyond.
    reach, reach_px:
        The window's half side as a share of the lattice step, and its limit in pixels.
    clear:
        Pixels farther than this share of a step from both edges are left out (markers there).
    iterations:
        Most Levenberg-Marquardt steps.
    marks:
        (h, w) share of each pixel that is dark print in the bright squares, blurred as the
        picture is; `NO_MARKS` where there is none.

    Returns
    -------
    (M, 7) fitted parameters, (M, 2, 2) covariance of x and y in px^2, (M,) standard deviation
    of the residual in grey levels. Where the fit broke down the latter two are NaN.
    """
    fitted, covariance, residual = _fit(
        image, marks, starts, steps, shapes, lines, reach_px, reach, clear, iterations
    )
    return fitted, covariance, residual
