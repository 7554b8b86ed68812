"""Rotations written by one rule and read by another: angles in another order, rotation vectors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import permutations
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from calib.views import FloatArray

Order = Literal["xyz", "XYZ", "ZYX", "zyx", "ZYZ", "ZXZ"]


@dataclass(frozen=True)
class _Rule:
    """Three numbers for a rotation: how they are read from it, and how they make one."""

    description: str
    numbers: Callable[[Rotation], FloatArray]
    rotation: Callable[[FloatArray], Rotation]


def _angles(order: Order, description: str) -> _Rule:
    return _Rule(
        description,
        lambda rotation: np.asarray(rotation.as_euler(order, suppress_warnings=True)),
        lambda numbers: Rotation.from_euler(order, numbers),
    )


RULES = (
    _angles("xyz", "roll, pitch, yaw about fixed x, y, z"),
    _angles("XYZ", "angles about turning x, y, z"),
    _angles("ZYX", "angles about turning z, y, x"),
    _angles("zyx", "angles about fixed z, y, x"),
    _angles("ZYZ", "angles about turning z, y, z"),
    _angles("ZXZ", "angles about turning z, x, z"),
    _Rule(
        "a rotation vector",
        lambda rotation: np.asarray(rotation.as_rotvec()),
        lambda numbers: Rotation.from_rotvec(numbers),
    ),
)


@cache
def readings() -> tuple[tuple[str, Callable[[FloatArray], FloatArray]], ...]:
    """What the log's rotations might be, in words, and (N, 4, 4) poses read so."""
    return tuple(
        (
            f"its rotation was written as {wrote.description} and read as {took.description}",
            _reading(wrote, took),
        )
        for wrote, took in permutations(RULES, 2)
    )


def _reading(wrote: _Rule, took: _Rule) -> Callable[[FloatArray], FloatArray]:
    def read(poses: FloatArray) -> FloatArray:
        out = poses.copy()
        known = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
        if known.any():
            numbers = took.numbers(Rotation.from_matrix(poses[known, :3, :3]))
            out[known, :3, :3] = wrote.rotation(numbers).as_matrix()
        return out

    return read
