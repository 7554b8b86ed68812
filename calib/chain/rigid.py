"""Rigid transforms as (..., 4, 4) arrays, for the loops where thousands are handled at once.

Compiled, since a linearised chain is a hundred evaluations and most of one is products of these:
numpy's own product of stacked 4 x 4 matrices takes six times as long.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from calib.views import FloatArray

_SMALL = 1e-8
"""Squared angle below which sine and cosine are given by their series."""


@njit(cache=True, nogil=True, error_model="numpy")
def _inverse(a, out):  # type: ignore[no-untyped-def]
    for n in range(a.shape[0]):
        for i in range(3):
            for j in range(3):
                out[n, i, j] = a[n, j, i]
            out[n, i, 3] = -(
                a[n, 0, i] * a[n, 0, 3] + a[n, 1, i] * a[n, 1, 3] + a[n, 2, i] * a[n, 2, 3]
            )
            out[n, 3, i] = 0.0
        out[n, 3, 3] = 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _product(a, b, out):  # type: ignore[no-untyped-def]
    for n in range(a.shape[0]):
        for i in range(3):
            for j in range(4):
                out[n, i, j] = (
                    a[n, i, 0] * b[n, 0, j] + a[n, i, 1] * b[n, 1, j] + a[n, i, 2] * b[n, 2, j]
                )
            out[n, i, 3] += a[n, i, 3]
            out[n, 3, i] = 0.0
        out[n, 3, 3] = 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _compose(rotvec, translation, out):  # type: ignore[no-untyped-def]
    """Rodrigues' formula."""
    for n in range(rotvec.shape[0]):
        x, y, z = rotvec[n, 0], rotvec[n, 1], rotvec[n, 2]
        square = x * x + y * y + z * z
        if square < _SMALL:
            s, c = 1.0 - square / 6.0, 0.5 - square / 24.0
        else:
            angle = math.sqrt(square)
            s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
        out[n, 0, 0] = 1.0 - c * (y * y + z * z)
        out[n, 1, 1] = 1.0 - c * (x * x + z * z)
        out[n, 2, 2] = 1.0 - c * (x * x + y * y)
        out[n, 0, 1], out[n, 1, 0] = c * x * y - s * z, c * x * y + s * z
        out[n, 0, 2], out[n, 2, 0] = c * x * z + s * y, c * x * z - s * y
        out[n, 1, 2], out[n, 2, 1] = c * y * z - s * x, c * y * z + s * x
        for i in range(3):
            out[n, i, 3] = translation[n, i]
            out[n, 3, i] = 0.0
        out[n, 3, 3] = 1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _to_vector(a, out):  # type: ignore[no-untyped-def]
    """Through the quaternion, from its largest component on (Shepperd 1978)."""
    q = np.zeros(4)
    for n in range(a.shape[0]):
        r = a[n]
        trace = r[0, 0] + r[1, 1] + r[2, 2]
        largest = 3
        size = trace
        for i in range(3):
            if r[i, i] > size:
                largest, size = i, r[i, i]
        if largest == 3:
            q[3] = 1.0 + trace
            q[0], q[1], q[2] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
        else:
            i = largest
            j, k = (i + 1) % 3, (i + 2) % 3
            q[i] = 1.0 + 2.0 * r[i, i] - trace
            q[j] = r[j, i] + r[i, j]
            q[k] = r[k, i] + r[i, k]
            q[3] = r[k, j] - r[j, k]
        sign = -1.0 if q[3] < 0.0 else 1.0
        length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
        w = abs(q[3])
        # 2 atan(t)/t = 2 - 2 t^2/3 for small t
        t = length / w if w > 0.0 else math.inf
        factor = (2.0 - 2.0 * t * t / 3.0) / w if t < 1e-4 else 2.0 * math.atan2(length, w) / length
        for i in range(3):
            out[n, i] = r[i, 3]
            out[n, 3 + i] = sign * factor * q[i]


def _flat(a_from_b: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """(N, 4, 4) contiguous, from transforms that broadcast to `shape`."""
    if a_from_b.shape[:-2] != shape:
        a_from_b = np.broadcast_to(a_from_b, (*shape, 4, 4))
    return np.ascontiguousarray(a_from_b, dtype=np.float64).reshape(-1, 4, 4)


def inverse(a_from_b: FloatArray) -> FloatArray:
    """(..., 4, 4) b_from_a of each transform."""
    out = np.empty(a_from_b.shape)
    _inverse(_flat(a_from_b, a_from_b.shape[:-2]), out.reshape(-1, 4, 4))
    return out


def product(a_from_b: FloatArray, b_from_c: FloatArray) -> FloatArray:
    """(..., 4, 4) a_from_c; the two broadcast against each other."""
    shape = a_from_b.shape[:-2]
    if b_from_c.shape[:-2] != shape:
        shape = np.broadcast_shapes(shape, b_from_c.shape[:-2])
    out = np.empty((*shape, 4, 4))
    _product(_flat(a_from_b, shape), _flat(b_from_c, shape), out.reshape(-1, 4, 4))
    return out


def compose(rotvec_rad: FloatArray, translation_m: FloatArray) -> FloatArray:
    """(..., 4, 4) transforms from (..., 3) rotation vectors, radians, and (..., 3) metres."""
    shape = rotvec_rad.shape[:-1]
    out = np.empty((*shape, 4, 4))
    rotvec = np.ascontiguousarray(rotvec_rad, dtype=np.float64).reshape(-1, 3)
    moved = np.broadcast_to(translation_m, (*shape, 3))
    translation = np.ascontiguousarray(moved, dtype=np.float64).reshape(-1, 3)
    _compose(rotvec, translation, out.reshape(-1, 4, 4))
    return out


def turn_from_axis(direction: FloatArray) -> FloatArray:
    """(N, 4, 4) shortest rotations that bring the z axis onto (N, 3) directions of any length."""
    aside = np.linalg.norm(direction[:, :2], axis=1)
    axis = np.column_stack([-direction[:, 1], direction[:, 0], np.zeros(len(direction))])
    angle = np.arctan2(aside, direction[:, 2])
    turn_rad = axis * (angle / np.maximum(aside, 1e-12))[:, None]
    return compose(turn_rad, np.zeros_like(turn_rad))


def from_vector(increment: FloatArray) -> FloatArray:
    """(..., 4, 4) transforms from (..., 6) increments: metres x, y, z, then a rotation vector."""
    return compose(increment[..., 3:], increment[..., :3])


def to_vector(transform: FloatArray) -> FloatArray:
    """(..., 6) increments of (..., 4, 4) transforms; the inverse of `from_vector`."""
    shape = transform.shape[:-2]
    out = np.empty((*shape, 6))
    _to_vector(_flat(transform, shape), out.reshape(-1, 6))
    return out


def twist(rate: FloatArray) -> FloatArray:
    """(..., 6) increments of (..., 4, 4) derivatives of transforms that pass through the unit."""
    half = 0.5 * (rate[..., :3, :3] - np.swapaxes(rate[..., :3, :3], -1, -2))
    return np.stack(
        [
            *(rate[..., k, 3] for k in range(3)),
            half[..., 2, 1],
            half[..., 0, 2],
            half[..., 1, 0],
        ],
        axis=-1,
    )


def skew(vector: FloatArray) -> FloatArray:
    """(..., 3, 3) matrices with skew(a) @ b = a x b."""
    out = np.zeros((*vector.shape[:-1], 3, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    out[..., 0, 1], out[..., 0, 2] = -z, y
    out[..., 1, 0], out[..., 1, 2] = z, -x
    out[..., 2, 0], out[..., 2, 1] = -y, x
    return out


def adjoint(a_from_b: FloatArray) -> FloatArray:
    """(..., 6, 6) matrices that carry a small (translation, rotation) increment from b to a."""
    out = np.zeros((*a_from_b.shape[:-2], 6, 6))
    rotation = a_from_b[..., :3, :3]
    out[..., :3, :3] = rotation
    out[..., 3:, 3:] = rotation
    out[..., :3, 3:] = skew(a_from_b[..., :3, 3]) @ rotation
    return out
