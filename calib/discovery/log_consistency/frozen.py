"""A pose that froze: the log repeats one row while the pictures go on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain import rigid
from calib.discovery.log_consistency.mixup import ROBOT_COLUMNS, Mixup
from calib.views import BoolArray, FloatArray, Views

_SAME = 1e-9
"""Metres and entries of the rotation: an arm that comes back logs other last digits."""

_FEWEST = 2
"""One frame with its neighbour's pose is a question of pairing."""

_MOVED_RAD, _MOVED_SHARE = 5e-3, 0.01
"""Pictures are of different poses from this angle, or this share of the distance, on."""


def find_frozen_poses(views: Views, loop: FloatArray) -> Mixup | None:
    """Name the frames that carry the pose logged before, though their pictures are of others.

    Parameters
    ----------
    views, loop:
        The log, and (N, 4, 4) mounted_from_fixed of the free poses.
    """
    stale = _repeats(views.base_from_flange) & _pictures_moved(views.base_from_flange, loop)
    if stale.sum() < _FEWEST:
        return None
    frames = frozenset(int(f) for f in views.frame[stale])
    first, last = min(frames), max(frames)

    def mend(some: Views, neighbours: Views) -> Views:
        lost = np.isin(some.frame, list(frames))
        columns = {name: getattr(some, name).copy() for name in ROBOT_COLUMNS}
        for column in columns.values():
            column[lost] = np.nan
        return replace(some, **columns)

    return Mixup(
        name="stale_poses",
        physics=(
            f"The logged pose stands still from frame {first} to {last} while the pictures go on:"
            f" {len(frames)} frames repeat the pose of one before them and are left out."
        ),
        remedy="Check that the pose is read anew for every picture, and record these frames again.",
        mend=mend,
        parameters={
            "from_frame": (float(first), "frame"),
            "to_frame": (float(last), "frame"),
            "frames": (float(len(frames)), "frame"),
        },
    )


def _repeats(poses: FloatArray) -> BoolArray:
    """(N,) whether a frame's pose is, to the last digit, that of the frame before."""
    same = np.zeros(len(poses), dtype=bool)
    same[1:] = np.abs(np.diff(poses, axis=0)).max(axis=(1, 2)) < _SAME
    return same


def _pictures_moved(poses: FloatArray, loop: FloatArray) -> BoolArray:
    """(N,) whether the picture differs from that of the last frame whose pose changed."""
    moved, first = np.zeros(len(loop), dtype=bool), 0
    for i, repeats in enumerate(_repeats(poses)):
        first = first if repeats else i
        if np.isfinite(loop[[first, i]]).all():
            step = rigid.to_vector(rigid.inverse(loop[first]) @ loop[i])
            far = _MOVED_SHARE * float(np.linalg.norm(loop[first, :3, 3]))
            moved[i] = np.linalg.norm(step[3:]) > _MOVED_RAD or np.linalg.norm(step[:3]) > far
    return moved
