"""Chains of Denavit-Hartenberg rows with Hayati's fifth parameter, many configurations at once.

A row is theta (offset of the joint, rad), d, a (m), alpha, beta (rad):
RotZ(q + theta) TransZ(d) TransX(a) RotX(alpha) RotY(beta). The first four are the "standard"
(distal) placement of Denavit and Hartenberg 1955, as in Siciliano et al., Robotics: Modelling,
Planning and Control, section 2.8.2. Two axes that are parallel in the drawing and not quite in the
arm have no finite d: beta says how they are askew (Hayati and Mirmirani 1985).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from calib.views import FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def place_links(joints, dh, ends, poses):  # type: ignore[no-untyped-def]
    """Write the poses (J + 1, 4, 4) of first frame and link frames in the base at (J,) joints."""
    poses[0] = ends[0]
    for k in range(joints.shape[0]):
        theta = joints[k] + dh[k, 0]
        ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(dh[k, 3]), math.sin(dh[k, 3])
        cb, sb = math.cos(dh[k, 4]), math.sin(dh[k, 4])
        before, pose = poses[k], poses[k + 1]
        pose[3] = before[3]
        for i in range(3):
            x, y, z = before[i, 0], before[i, 1], before[i, 2]
            along = ct * x + st * y
            across = ct * y - st * x
            forth = ca * z - sa * across
            pose[i, 0] = cb * along - sb * forth
            pose[i, 1] = ca * across + sa * z
            pose[i, 2] = cb * forth + sb * along
            pose[i, 3] = before[i, 3] + dh[k, 1] * z + dh[k, 2] * along
    poses[joints.shape[0]] = poses[joints.shape[0]] @ ends[1]


@njit(cache=True, nogil=True, error_model="numpy")
def _tips(joints, rows, out):  # type: ignore[no-untyped-def]
    """Turn and shift the columns of each pose, link by link; `rows` has one entry or one each."""
    links = joints.shape[1]
    twist = np.empty((4, links))
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
                twist[2, k], twist[3, k] = math.cos(dh[k, 4]), math.sin(dh[k, 4])
            ct, st, ca, sa = math.cos(theta), math.sin(theta), twist[0, k], twist[1, k]
            cb, sb = twist[2, k], twist[3, k]
            for i in range(3):
                x, y, z = pose[i, 0], pose[i, 1], pose[i, 2]
                along = ct * x + st * y
                across = ct * y - st * x
                forth = ca * z - sa * across
                pose[i, 0] = cb * along - sb * forth
                pose[i, 1] = ca * across + sa * z
                pose[i, 2] = cb * forth + sb * along
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
        (6, 5) or (..., 6, 5) rows (theta offset, d, a, alpha, beta), radians and metres.

    Returns
    -------
    FloatArray
        (..., 6, 4, 4).
    """
    theta = joints_rad + dh[..., 0]
    d, a, alpha, beta = (np.broadcast_to(dh[..., k], theta.shape) for k in (1, 2, 3, 4))
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    cb, sb = np.cos(beta), np.sin(beta)
    links = np.zeros((*theta.shape, 4, 4))
    links[..., 0, 0], links[..., 0, 1] = ct * cb - st * sa * sb, -st * ca
    links[..., 0, 2], links[..., 0, 3] = ct * sb + st * sa * cb, a * ct
    links[..., 1, 0], links[..., 1, 1] = st * cb + ct * sa * sb, ct * ca
    links[..., 1, 2], links[..., 1, 3] = st * sb - ct * sa * cb, a * st
    links[..., 2, 0], links[..., 2, 1], links[..., 2, 2] = -ca * sb, sa, ca * cb
    links[..., 2, 3], links[..., 3, 3] = d, 1.0
    return links


def rows(*standard: tuple[float, float, float, float]) -> FloatArray:
    """Rows (6, 5) of an arm whose drawing has standard parameters only."""
    return np.column_stack([np.array(standard), np.zeros(len(standard))])


def frames(joints_rad: FloatArray, dh: FloatArray) -> FloatArray:
    """Poses (..., 7, 4, 4) of the base frame and the six link frames in the base."""
    links = link_transforms(joints_rad, dh)
    chain = np.empty((*links.shape[:-3], 7, 4, 4))
    chain[..., 0, :, :] = np.eye(4)
    for i in range(6):
        chain[..., i + 1, :, :] = chain[..., i, :, :] @ links[..., i, :, :]
    return chain
