"""A chain of rows for any six axes in space, with a frame before and one behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from calib.chain.kinematics.dh import link_transforms
from calib.views import FloatArray

_PARALLEL = float(np.sin(np.radians(3.0)))
"""Axes less askew than this have their row after Hayati: their common normal is somewhere far."""

_SAME_M = 1e-9


class Axis(NamedTuple):
    """A joint's axis at zero joint angles: a point on it (m), its unit direction; in the base."""

    point_m: FloatArray
    direction: FloatArray


def chain_from_axes(
    axes: Sequence[Axis], base_from_flange: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rows of a chain with these axes, and the transforms at its ends.

    Parameters
    ----------
    axes, base_from_flange:
        The joints' axes in their order, and the flange, all at zero joint angles.

    Returns
    -------
    rows, ends
        (J, 5), see `dh`; (2, 4, 4): base_from_first and last_from_flange.

    The choice that a drawing leaves open is made so that nothing can hide: an axis parallel to the
    one before has d = 0 (Hayati and Mirmirani 1985), any other has beta = 0.
    """
    first = _upright(axes[0])
    frame, rows = first, []
    for axis in axes[1:]:
        row = _row(frame, axis)
        rows.append(row)
        frame = frame @ link_transforms(np.zeros(1), row[None])[0]
    rows.append(np.zeros(5))
    return np.array(rows), np.array([first, np.linalg.solve(frame, base_from_flange)])


def _upright(axis: Axis) -> FloatArray:
    """(4, 4) a frame on an axis, z along it, x as near to the base's as it can."""
    z = axis.direction
    spare = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = spare - (spare @ z) * z
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = axis.point_m - (axis.point_m @ z) * z
    return pose


def _row(frame: FloatArray, axis: Axis) -> FloatArray:
    """The row (5,) that leads from a frame to one on the next axis."""
    point = frame[:3, :3].T @ (axis.point_m - frame[:3, 3])
    z = frame[:3, :3].T @ axis.direction
    askew = float(np.hypot(z[0], z[1]))
    return _hayati(point, z) if askew < _PARALLEL else _standard(point, z, askew)


def _hayati(point: FloatArray, z: FloatArray) -> FloatArray:
    crossing = point - point[2] / z[2] * z
    a = float(np.hypot(crossing[0], crossing[1]))
    theta = float(np.arctan2(crossing[1], crossing[0])) if a > _SAME_M else 0.0
    c, s = np.cos(theta), np.sin(theta)
    along, across = c * z[0] + s * z[1], c * z[1] - s * z[0]
    beta = float(np.arcsin(np.clip(along, -1, 1)))
    return np.array([theta, 0.0, a, np.arctan2(-across, z[2]), beta])


def _standard(point: FloatArray, z: FloatArray, askew: float) -> FloatArray:
    """By the common normal of the frame's z axis and the next axis."""
    x = np.array([-z[1], z[0], 0.0]) / askew
    theta = float(np.arctan2(x[1], x[0]))
    a = float(point @ x)
    across = np.array([-x[1], x[0], 0.0])
    along = -(point @ across) / (z @ across)
    d = float(point[2] + along * z[2])
    return np.array([theta, d, a, np.arctan2(-(z @ across), z[2]), 0.0])
