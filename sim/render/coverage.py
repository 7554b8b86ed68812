"""How much light each pixel gets from the pattern: edges integrated over the pixel's square."""

from __future__ import annotations

import numpy as np
from numba import njit

from sim.render.pattern import BACKGROUND, Pattern, leaf
from sim.render.surface import NODE_STEP_PX, Image, Nodes

STEP = NODE_STEP_PX

_SAMPLES = 1024
# Points (i, i * 275 mod 1024) fill the square evenly, and each axis sees 1024 different values,
# so that an edge along a pixel row is placed to a thousandth of a pixel (Korobov 1959).
_GENERATOR = 275
_LATTICE = np.stack(
    [
        (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5,
        (np.arange(_SAMPLES) * _GENERATOR % _SAMPLES + 0.5) / _SAMPLES - 0.5,
    ],
    axis=1,
)


def integrate(pattern: Pattern, nodes: Nodes, width_px: int, height_px: int) -> Image:
    """(height, width) float32 mean reflectance over each pixel's square.

    A straight edge through a pixel is integrated in closed form; a pixel with more than one
    edge in it by 1024 samples of an even lattice.
    """
    image = np.full((height_px, width_px), BACKGROUND, np.float32)
    _fill(image, nodes.s, nodes.t, pattern.shape, pattern.bits, pattern.marker_of_square, _LATTICE)
    return image


@njit(cache=True)
def _weights(f, w, d):  # type: ignore[no-untyped-def]
    """Catmull-Rom weights at fraction f between the middle two of four nodes, and derivative."""
    f2, f3 = f * f, f * f * f
    w[0] = -0.5 * f3 + f2 - 0.5 * f
    w[1] = 1.5 * f3 - 2.5 * f2 + 1.0
    w[2] = -1.5 * f3 + 2.0 * f2 + 0.5 * f
    w[3] = 0.5 * f3 - 0.5 * f2
    d[0] = (-1.5 * f2 + 2.0 * f - 0.5) / STEP
    d[1] = (4.5 * f2 - 5.0 * f) / STEP
    d[2] = (-4.5 * f2 + 4.0 * f + 0.5) / STEP
    d[3] = (1.5 * f2 - f) / STEP


@njit(cache=True, nogil=True)
def _fill(image, s_nodes, t_nodes, shape, bits, markers, lattice):  # type: ignore[no-untyped-def]
    height, width = image.shape
    cols = s_nodes.shape[1]
    wv, dv = np.empty(4), np.empty(4)
    wu, du = np.empty((STEP, 4)), np.empty((STEP, 4))
    for x in range(STEP):
        _weights(x / STEP, wu[x], du[x])
    lines = np.empty((4, cols))  # s, t and their derivatives by v, at this row
    for v in range(height):
        i = v // STEP
        _weights((v % STEP) / STEP, wv, dv)
        for j in range(cols):
            lines[:, j] = 0.0
            for k in range(4):
                lines[0, j] += wv[k] * s_nodes[i + k, j]
                lines[1, j] += wv[k] * t_nodes[i + k, j]
                lines[2, j] += dv[k] * s_nodes[i + k, j]
                lines[3, j] += dv[k] * t_nodes[i + k, j]
        for j in range((width + STEP - 1) // STEP):
            run = image[v, j * STEP : min((j + 1) * STEP, width)]
            _fill_run(run, lines[:, j : j + 4], wu, du, shape, bits, markers, lattice)


@njit(cache=True)
def _fill_run(run, p, wu, du, shape, bits, markers, lattice):  # type: ignore[no-untyped-def]
    """Up to `STEP` pixels between two columns of nodes; `p` holds four columns of lines."""
    box = np.array([1.0, 0.0, 1.0, 0.0])
    slope = np.empty((2, 2))
    value = 0.0
    for x in range(run.shape[0]):
        w, d = wu[x], du[x]
        s = w[0] * p[0, 0] + w[1] * p[0, 1] + w[2] * p[0, 2] + w[3] * p[0, 3]
        t = w[0] * p[1, 0] + w[1] * p[1, 1] + w[2] * p[1, 2] + w[3] * p[1, 3]
        if not (np.isfinite(s) and np.isfinite(t)):
            continue
        slope[0, 0] = d[0] * p[0, 0] + d[1] * p[0, 1] + d[2] * p[0, 2] + d[3] * p[0, 3]
        slope[1, 0] = d[0] * p[1, 0] + d[1] * p[1, 1] + d[2] * p[1, 2] + d[3] * p[1, 3]
        slope[0, 1] = w[0] * p[2, 0] + w[1] * p[2, 1] + w[2] * p[2, 2] + w[3] * p[2, 3]
        slope[1, 1] = w[0] * p[3, 0] + w[1] * p[3, 1] + w[2] * p[3, 2] + w[3] * p[3, 3]
        if not (box[0] <= s < box[1] and box[2] <= t < box[3]):
            value = leaf(s, t, shape, bits, markers, box)
        reach_s = 0.5 * (abs(slope[0, 0]) + abs(slope[0, 1]))
        reach_t = 0.5 * (abs(slope[1, 0]) + abs(slope[1, 1]))
        cut_s = s - reach_s < box[0] or s + reach_s > box[1]
        cut_t = t - reach_t < box[2] or t + reach_t > box[3]
        if not cut_s and not cut_t:
            run[x] = value
            continue
        mean = -1.0
        if cut_s != cut_t:
            axis = 0 if cut_s else 1
            mean = _one_edge(s, t, slope, axis, value, box, shape, bits, markers)
        if mean < 0.0:
            mean = _many_edges(s, t, slope, lattice, shape, bits, markers)
        run[x] = mean


@njit(cache=True)
def _one_edge(s, t, slope, axis, value, box, shape, bits, markers):  # type: ignore[no-untyped-def]
    """Mean reflectance where one straight edge runs through the pixel; -1 where more do."""
    here = s if axis == 0 else t
    low, high = box[2 * axis], box[2 * axis + 1]
    at_low = here - low < high - here
    line = low if at_low else high
    beyond_s = 2.0 * line - s if axis == 0 else s
    beyond_t = 2.0 * line - t if axis == 1 else t
    other = np.empty(4)
    beyond = leaf(beyond_s, beyond_t, shape, bits, markers, other)
    reach = 0.5 * (abs(slope[axis, 0]) + abs(slope[axis, 1]))
    if high - low < 2.0 * reach or other[2 * axis + 1] - other[2 * axis] < 2.0 * reach:
        return -1.0
    across = 1 - axis
    there = t if axis == 0 else s
    reach = 0.5 * (abs(slope[across, 0]) + abs(slope[across, 1]))
    if there - reach < other[2 * across] or there + reach > other[2 * across + 1]:
        return -1.0
    below = _half_plane(line - here, abs(slope[axis, 0]), abs(slope[axis, 1]))
    inside = 1.0 - below if at_low else below
    return inside * value + (1.0 - inside) * beyond


@njit(cache=True)
def _many_edges(s, t, slope, lattice, shape, bits, markers):  # type: ignore[no-untyped-def]
    """Mean reflectance of a pixel by samples, whatever runs through it."""
    box = np.empty(4)
    total = 0.0
    for k in range(lattice.shape[0]):
        x, y = lattice[k, 0], lattice[k, 1]
        at_s = s + slope[0, 0] * x + slope[0, 1] * y
        at_t = t + slope[1, 0] * x + slope[1, 1] * y
        total += leaf(at_s, at_t, shape, bits, markers, box)
    return total / lattice.shape[0]


@njit(cache=True)
def _half_plane(offset, a, b):  # type: ignore[no-untyped-def]
    """Share of the unit square around 0 in which a x + b y < offset, for a, b >= 0."""
    if a < b:
        a, b = b, a
    if b < 1e-9 * a:
        return min(max(offset / a + 0.5, 0.0), 1.0)
    total = 0.0
    for sign_a in (-0.5, 0.5):
        for sign_b in (-0.5, 0.5):
            edge = max(offset - sign_a * a - sign_b * b, 0.0)
            # inclusion-exclusion over the square's corners
            total += edge * edge if sign_a * sign_b > 0 else -edge * edge
    return min(max(total / (2.0 * a * b), 0.0), 1.0)
