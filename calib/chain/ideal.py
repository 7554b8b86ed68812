"""The image of a lens without distortion: how far from the axis a direction is seen.

A point at distance rho from the axis and depth z is seen at (x, y) g. In a perspective image the
distance grows with the angle's tangent, g = 1/z. In an equidistant one, which wide lenses are built
for (Kannala and Brandt 2006), it grows with the angle itself, g = atan2(rho, z)/rho, and directions
at and behind the camera's own plane have a place, too.

Into a block's rows go the ideal point, g, its derivative by rho over rho, and that by z.
"""

from __future__ import annotations

import math

from numba import njit

from calib.chain.rows import ZS, A, B, G, H, S, X, Y

_NEAR_AXIS = 1e-3
"""Square of the tangent below which the series is exact to rounding and the quotient is not."""


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def perspective(count, work):  # type: ignore[no-untyped-def]
    """As a pinhole shows it."""
    for j in range(count):
        per_z = 1.0 / work[ZS + j]
        work[A + j], work[B + j] = work[X + j] * per_z, work[Y + j] * per_z
        work[G + j], work[H + j], work[S + j] = per_z, 0.0, -per_z * per_z


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def equidistant(count, work):  # type: ignore[no-untyped-def]
    """As far from the middle as the angle from the axis says."""
    for j in range(count):
        x, y, z = work[X + j], work[Y + j], work[ZS + j]
        rho2 = x * x + y * y
        d2 = rho2 + z * z
        if z > 0.0 and rho2 < _NEAR_AXIS * z * z:
            t2 = rho2 / (z * z)
            g = (1.0 - t2 * (1.0 / 3.0 - t2 * (0.2 - t2 * (1.0 / 7.0 - t2 / 9.0)))) / z
            h = -(2.0 / 3.0 - t2 * (0.8 - t2 * (6.0 / 7.0 - t2 * 8.0 / 9.0))) / (z * z * z)
        else:
            rho = math.sqrt(rho2)
            g = math.atan2(rho, z) / rho
            h = (z / d2 - g) / rho2
        work[A + j], work[B + j] = x * g, y * g
        work[G + j], work[H + j], work[S + j] = g, h, -1.0 / d2
