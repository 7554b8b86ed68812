"""Chains of standard Denavit-Hartenberg rows, many configurations at once."""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray


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
