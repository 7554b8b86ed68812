"""Where the camera could stand: fronto-parallel series and tilted views of the board."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.views import FloatArray
from cell.devices.planned_camera import PlannedCamera

QUARTER_TURNS_RAD = np.radians([0.0, 180.0, 90.0, -90.0])
TWELFTHS_RAD = np.radians(30.0 * np.arange(12))
TILT_RAD = (np.radians(12.0), np.radians(42.0))
_SHARES = np.linspace(0.9, 0.0, 10)
"""Of the way from the image's middle to its edge, for the board's centre."""

_MOST_MISSES = 500

BY_HAND_TILT_RAD = (np.radians(15.0), np.radians(3.0))
"""Tilt of the nearest and of the farthest view when a board is photographed by hand."""


def parallel(
    sight: PlannedCamera, distance_m: float, rolls_rad: FloatArray = QUARTER_TURNS_RAD
) -> Iterator[RigidTransform]:
    """Fronto-parallel views (camera_from_board) at one distance, by preference of the roll."""
    ahead = np.array([0.0, 0.0, distance_m])
    for roll in rolls_rad:
        turn = Rotation.from_rotvec([0.0, 0.0, roll])
        if sight.whole(turn, ahead):
            yield sight.placed(turn, ahead)


def varied(
    sight: PlannedCamera, distances_m: tuple[float, float], seed: int, *, by_hand: bool = False
) -> Iterator[RigidTransform]:
    """Tilted views (camera_from_board), spread evenly over what may vary, as many as are asked for.

    It ends where the camera does not see the board whole in five hundred tries one after another.

    `by_hand`: most of them near and tilted, the far ones flat, as a board is photographed by
    hand. Perspective then comes from the near views, and a lens that breathes biases Zhang's fit
    most; a plan to show that, not to calibrate by.
    """
    from scipy.stats import qmc  # a second's import, for plans only

    spread = qmc.Halton(5, seed=seed)
    misses = 0
    while misses < _MOST_MISSES:
        tilt, azimuth, roll, far, corner = spread.random()[0]
        axis = np.array([np.cos(2 * np.pi * azimuth), np.sin(2 * np.pi * azimuth), 0.0])
        far = far**3 if by_hand else far
        angle = TILT_RAD[0] + tilt * np.ptp(TILT_RAD)
        if by_hand:
            angle = np.interp(far, [0, 1], BY_HAND_TILT_RAD) * (0.7 + 0.6 * tilt)
        turn = Rotation.from_rotvec(angle * axis)
        turn = Rotation.from_rotvec([0.0, 0.0, 2 * np.pi * roll]) * turn
        distance = distances_m[0] + far * (distances_m[1] - distances_m[0])
        view = _pushed_aside(sight, turn, distance, 2 * np.pi * corner)
        misses = misses + 1 if view is None else 0
        if view is not None:
            yield view


def _pushed_aside(
    sight: PlannedCamera, turn: Rotation, distance_m: float, direction_rad: float
) -> RigidTransform | None:
    """The board as far towards the image's edge as it goes while it is whole."""
    half = 0.5 * np.array([sight.width_px, sight.height_px]) / sight.alpha_px
    towards = half * np.array([np.cos(direction_rad), np.sin(direction_rad)])
    centres = distance_m * np.column_stack([_SHARES[:, None] * towards, np.ones(len(_SHARES))])
    whole = np.flatnonzero(sight.whole(turn, centres))
    return sight.placed(turn, centres[whole[0]]) if len(whole) else None
