"""Rigid transforms as (..., 4, 4) arrays, for the loops where thousands are handled at once."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from calib.views import FloatArray


def inverse(a_from_b: FloatArray) -> FloatArray:
    """(..., 4, 4) b_from_a of each transform."""
    out = np.zeros_like(a_from_b)
    rotation_t = np.swapaxes(a_from_b[..., :3, :3], -1, -2)
    out[..., :3, :3] = rotation_t
    out[..., :3, 3] = -(rotation_t @ a_from_b[..., :3, 3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def compose(rotvec_rad: FloatArray, translation_m: FloatArray) -> FloatArray:
    """(..., 4, 4) transforms from (..., 3) rotation vectors, radians, and (..., 3) metres."""
    out = np.zeros((*rotvec_rad.shape[:-1], 4, 4))
    flat = Rotation.from_rotvec(rotvec_rad.reshape(-1, 3)).as_matrix()
    out[..., :3, :3] = flat.reshape(*rotvec_rad.shape[:-1], 3, 3)
    out[..., :3, 3] = translation_m
    out[..., 3, 3] = 1.0
    return out


def from_vector(increment: FloatArray) -> FloatArray:
    """(..., 4, 4) transforms from (..., 6) increments: metres x, y, z, then a rotation vector."""
    return compose(increment[..., 3:], increment[..., :3])


def to_vector(transform: FloatArray) -> FloatArray:
    """(..., 6) increments of (..., 4, 4) transforms; the inverse of `from_vector`."""
    shape = transform.shape[:-2]
    rotvec = Rotation.from_matrix(transform[..., :3, :3].reshape(-1, 3, 3)).as_rotvec()
    return np.concatenate([transform[..., :3, 3], rotvec.reshape(*shape, 3)], axis=-1)


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
