"""Chains of standard Denavit-Hartenberg rows, many configurations at once."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from calib.views import FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def _tips(joints, rows, out):  # type: ignore[no-untyped-def]
    """Turn and shift the columns of each pose, link by link; `rows` has one entry or one each."""
    links = joints.shape[1]
    twist = np.empty((2, links))
    for n in range(joints.shape[0]):
        dh = rows[n if rows.shape[0] > 1 else 0]
        pose = out[n]
        pose[:, :] = 0.0
        for i in range(4):
            pose[i, i] = 1.0
        for k in range(links):
            theta = joints[n, k] + dh[k, 0]
            if n == 0 or rows.shape[0] > 1:
                twist[0, k], twist[1, k] = math.cos(dh[k, 3]), math.sin(dh[k, 3])
            ct, st, ca, sa = math.cos(theta), math.sin(theta), twist[0, k], twist[1, k]
            for i in range(3):
                x, y, z = pose[i, 0], pose[i, 1], pose[i, 2]
                along = ct * x + st * y
                across = ct * y - st * x
                pose[i, 0] = along
                pose[i, 1] = ca * across + sa * z
                pose[i, 2] = ca * z - sa * across
                pose[i, 3] += dh[k, 1] * z + dh[k, 2] * along


def tips(joints_rad: FloatArray, dh: FloatArray) -> FloatArray:
    """Pose (..., 4, 4) of the last link's frame in the base; arguments as `link_transforms`."""
    shape = np.broadcast_shapes(joints_rad.shape[:-1], dh.shape[:-2])
    joints = np.broadcast_to(joints_rad, (*shape, joints_rad.shape[-1]))
    rows = dh if dh.ndim == 2 else np.broadcast_to(dh, (*shape, *dh.shape[-2:]))
    out = np.empty((*shape, 4, 4))
    _tips(
        np.ascontiguousarray(joints, dtype=np.float64).reshape(-1, joints.shape[-1]),
        np.ascontiguousarray(rows, dtype=np.float64).reshape(-1, *dh.shape[-2:]),
        out.reshape(-1, 4, 4),
    )
    return out


def link_transforms(joints_rad: FloatArray, dh: FloatArray) -> FloatArray:
    """Transforms from each link frame to the one before it.

    Parameters
    ----------
    joints_rad:
        (..., 6) joint angles, radians.
    dh:
        (6, 4) or (..., 6, 4) rows (theta offset, d, a, alpha), radians and metres.

    Returns
    -------
    FloatArray
        (..., 6, 4, 4): RotZ(theta) TransZ(d) TransX(a) RotX(alpha).
        Source: Denavit and Hartenberg 1955 in the "standard" (distal) placement, as in
        Siciliano et al., Robotics: Modelling, Planning and Control, section 2.8.2.
    """
    theta = joints_rad + dh[..., 0]
    d, a, alpha = (np.broadcast_to(dh[..., k], theta.shape) for k in (1, 2, 3))
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    links = np.zeros((*theta.shape, 4, 4))
    links[..., 0, 0], links[..., 0, 1], links[..., 0, 2] = ct, -st * ca, st * sa
    links[..., 1, 0], links[..., 1, 1], links[..., 1, 2] = st, ct * ca, -ct * sa
    links[..., 2, 1], links[..., 2, 2] = sa, ca
    links[..., 0, 3], links[..., 1, 3], links[..., 2, 3] = a * ct, a * st, d
    links[..., 3, 3] = 1.0
    return links


def frames(joints_rad: FloatArray, dh: FloatArray) -> FloatArray:
    """Poses (..., 7, 4, 4) of the base frame and the six link frames in the base."""
    links = link_transforms(joints_rad, dh)
    chain = np.empty((*links.shape[:-3], 7, 4, 4))
    chain[..., 0, :, :] = np.eye(4)
    for i in range(6):
        chain[..., i + 1, :, :] = chain[..., i, :, :] @ links[..., i, :, :]
    return chain
