"""The chain once more, by other formulas, for automatic differentiation: an oracle for the tests.

Written from the sources that the chain names and from nothing of the project's own code: rotations
by Rodrigues' formula, the tilted sensor by its matrices, the window by Snell's law on the angles,
the arm by a product of elementary transforms.
"""

from __future__ import annotations

from typing import Any

import autograd.numpy as anp
from autograd.tracer import getval

Array = Any
INDEX = 1.5


def plain(value: Array) -> Any:
    """The number without its derivatives, for decisions."""
    return getval(value)


def cross_matrix(w: Array) -> Array:
    return anp.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def rotation(w: Array) -> Array:
    """Rodrigues; by its series near zero, where the angle has no derivative."""
    square = anp.dot(w, w)
    K = cross_matrix(w)
    if square < 1e-12:
        return anp.eye(3) + K + 0.5 * anp.dot(K, K)
    angle = anp.sqrt(square)
    s, c = anp.sin(angle) / angle, (1.0 - anp.cos(angle)) / square
    return anp.eye(3) + s * K + c * anp.dot(K, K)


def rigid(increment: Array) -> Array:
    """(4, 4) from metres and a rotation vector."""
    top = anp.concatenate([rotation(increment[3:]), increment[:3].reshape(3, 1)], axis=1)
    return anp.concatenate([top, anp.array([[0.0, 0.0, 0.0, 1.0]])], axis=0)


def turn(axis: int, angle: Array) -> Array:
    unit = anp.eye(3)[axis]
    return rigid(anp.concatenate([anp.zeros(3), unit * angle]))


def shift(axis: int, length: Array) -> Array:
    return rigid(anp.concatenate([anp.eye(3)[axis] * length, anp.zeros(3)]))


def flange(joints: Array, dh: Array) -> Array:
    """Denavit and Hartenberg's product of elementary transforms, and Hayati's, row by row."""
    pose = anp.eye(4)
    for q, (theta, d, a, alpha, beta) in zip(joints, dh, strict=True):
        steps = (turn(2, q + theta), shift(2, d), shift(0, a), turn(0, alpha), turn(1, beta))
        for step in steps:
            pose = anp.dot(pose, step)
    return pose


def camera_coordinates(pose: Array, point: Array) -> Array:
    return anp.dot(pose[:3, :3], point) + pose[:3, 3]


def pixel(o: dict[str, Array], p: Array) -> Array:
    """(2, ...) pixels of (3, ...) points in the camera's frame."""
    radius = anp.sqrt(p[0] ** 2 + p[1] ** 2)
    angle = anp.arctan2(radius, p[2])
    inside = anp.arcsin(anp.sin(angle) / INDEX)
    window = o["window_m"] * (1.0 - anp.tan(inside) / anp.tan(angle))
    depth = p[2] + o["pupil_m_rad2"] * angle**2 - window
    if o["equidistant"]:
        # Kannala and Brandt 2006, Eq. 6 without its outer factor: the angle, along the azimuth
        azimuth, r = anp.arctan2(p[1], p[0]), anp.arccos(depth / anp.sqrt(radius**2 + depth**2))
        x, y, r2 = r * anp.cos(azimuth), r * anp.sin(azimuth), r**2
        radial = 1 + o["k1"] * r2 + o["k2"] * r2**2 + o["k3"] * r2**3 + o["k4"] * r2**4
    else:
        x, y = p[0] / depth, p[1] / depth
        r2 = x * x + y * y
        radial = (1 + o["k1"] * r2 + o["k2"] * r2**2 + o["k3"] * r2**3) / (
            1 + o["k4"] * r2 + o["k5"] * r2**2 + o["k6"] * r2**3
        )
    xd = x * radial + 2 * o["p1"] * x * y + o["p2"] * (r2 + 2 * x * x)
    yd = y * radial + o["p1"] * (r2 + 2 * y * y) + 2 * o["p2"] * x * y
    xd = xd + o["s1"] * r2 + o["s2"] * r2**2
    yd = yd + o["s3"] * r2 + o["s4"] * r2**2
    tx, ty = o["tilt_x_rad"], o["tilt_y_rad"]
    R = anp.dot(turn(1, -ty)[:3, :3], turn(0, -tx)[:3, :3])
    lift = anp.array([[R[2, 2], 0.0, -R[0, 2]], [0.0, R[2, 2], -R[1, 2]], [0.0, 0.0, 1.0]])
    t = anp.dot(lift, anp.dot(R, anp.array([xd, yd, anp.ones_like(xd)])))
    u = o["alpha_px"] * t[0] / t[2] + o["skew_px"] * t[1] / t[2] + o["u0_px"]
    v = o["beta_px"] * t[1] / t[2] + o["v0_px"]
    return anp.array([u, v])


SWEEP = tuple(f"sweep_{part}" for part in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"))


def swept_pixel(o: dict[str, Array], p: Array) -> Array:
    """`pixel` of (3, ...) points that move on until their rows are read."""
    sweep = anp.stack([o[name] for name in SWEEP])
    along = anp.reshape(sweep[:3], (3,) + (1,) * (p.ndim - 1))
    motion = along + anp.dot(cross_matrix(sweep[3:]), p)
    seen = pixel(o, p)
    for _ in range(12 if plain(sweep).any() else 1):
        late = seen[1] / o["height_px"] - 0.5 - o["pose_row"]
        seen = pixel(o, p + late * motion)
    return seen
