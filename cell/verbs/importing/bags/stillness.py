"""Which pictures were taken while the arm stood still, one for each time that it did."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.views import BoolArray, FloatArray
from cell.verbs.importing.bags.robot import Robot

_WINDOW_S = 0.15
"""The arm stands still at a picture when it does so from this long before until as long after: a
stamp may be off by an exposure and a transfer."""
_STILL_M, _STILL_RAD = 3e-4, 5e-4
"""What it may move within: logs of arms that stand show up to 0.05 mm and 0.003 degrees."""
_SAMPLES = 7
_FEWEST_STOPS = 8
"""From so many standstills on a bag is one of stops; a calibration needs about as many."""
_MOST_MOVING = 120


def still(robot: Robot, times_s: FloatArray) -> BoolArray:
    """(N,) whether the flange stood still around each time."""
    if not len(times_s):
        return np.zeros(0, dtype=bool)
    around = np.linspace(-_WINDOW_S, _WINDOW_S, _SAMPLES)
    poses = robot.poses((times_s[:, None] + around).ravel()).reshape(len(times_s), _SAMPLES, 4, 4)
    moved_m, turned = _apart(poses, poses[:, [_SAMPLES // 2]])
    return np.asarray((moved_m.max(axis=1) < _STILL_M) & (turned.max(axis=1) < _STILL_RAD))


def _apart(poses: FloatArray, others: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distance in metres, and about the angle in radians, between poses."""
    place = np.linalg.norm(poses[..., :3, 3] - others[..., :3, 3], axis=-1)
    turn = np.linalg.norm(poses[..., :3, :3] - others[..., :3, :3], axis=(-2, -1)) / np.sqrt(2)
    return place, turn


def one_each(robot: Robot, times_s: FloatArray, standing: BoolArray) -> NDArray[np.int64]:
    """Indices of the middle picture of every standstill; `times_s` increase."""
    groups: list[list[int]] = []
    poses = robot.poses(times_s)
    for k in np.flatnonzero(standing):
        before = groups[-1] if groups else None
        if before is not None and before[-1] == k - 1:
            moved_m, turned = _apart(poses[k], poses[before[0]])
            if moved_m < _STILL_M and turned < _STILL_RAD:
                before.append(int(k))
                continue
        groups.append([int(k)])
    return np.array([group[len(group) // 2] for group in groups], dtype=np.int64)


def choose(
    robot: Robot, times_s: FloatArray, usable: BoolArray, take: str | None
) -> tuple[NDArray[np.int64], bool, str]:
    """Which pictures to take, whether of a moving arm, and the reason in words.

    Parameters
    ----------
    times_s:
        (P,) increasing.
    usable:
        (P,) those with a pose.
    take:
        `still`, `moving` or `all`; None where the bag decides.
    """
    standing = still(robot, times_s) & usable
    stops = one_each(robot, times_s, standing)
    if take == "still" or (take is None and len(stops) >= _FEWEST_STOPS):
        return stops, False, f"the middle picture of each of {len(stops)} standstills is taken"
    if take == "all":
        return np.flatnonzero(usable), not standing[usable].all(), "every picture is taken"
    moving = np.flatnonzero(usable)
    some = moving[np.unique(np.linspace(0, len(moving) - 1, _MOST_MOVING).astype(int))]
    why = (
        f"the arm stood still {len(stops)} times only: {len(some)} pictures are taken while it"
        " moved, and the recording says `capture: moving`"
    )
    return some, True, why
