"""By how much the pictures' clock is off from the joints': what their turns say.

Between two pictures the camera turns by an angle that the pictures show, whatever the mount, and
the flange turns by the same angle. The offset at which both agree is the clocks' difference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.detection.orientation import RoughPoses, turned_order, turns_to_agree
from calib.views import Board, FloatArray
from cell.verbs.importing.bags.robot import Robot

_SPAN_S, _STEP_S = 0.5, 0.01
_FEWEST_PAIRS = 12
_TELLING_S = 0.01
"""A wider sigma says nothing."""
_ROUNDS, _SLOPE_S = 12, 0.002


@dataclass(frozen=True)
class ClockOffset:
    """Seconds to add to a picture's stamp to find the joints that belong to it, one sigma."""

    offset_s: float
    sigma_s: float

    @property
    def sure(self) -> bool:
        """Whether it differs from none by more than chance."""
        return abs(self.offset_s) > 4 * self.sigma_s


def clock_offset(
    robot: Robot, times_s: FloatArray, corners_px: FloatArray, board: Board
) -> ClockOffset | None:
    """Estimate the offset from N whole views of the board, some of a moving arm.

    Parameters
    ----------
    times_s:
        (N,) increasing, stamps of the pictures.
    corners_px:
        (N, M, 2).

    Returns
    -------
    None where the pictures do not show: too few, or the arm hardly turned meanwhile.
    """
    if len(times_s) <= _FEWEST_PAIRS:
        return None
    turns = turns_to_agree(corners_px, board)
    orders = [turned_order(board, int(turn)) for turn in turns]
    named = np.array([px[order] for px, order in zip(corners_px, orders, strict=True)])
    camera = RoughPoses.of(named, board).camera
    first, second = _pairs(len(times_s))
    seen = (camera[first] * camera[second].inv()).magnitude()

    def misfit(tau_s: float) -> FloatArray:
        turned = Rotation.from_matrix(robot.poses(times_s + tau_s)[:, :3, :3])
        return np.asarray((turned[first].inv() * turned[second]).magnitude() - seen)

    grid = np.arange(-_SPAN_S, _SPAN_S + _STEP_S / 2, _STEP_S)
    costs = [float(np.abs(misfit(tau)).mean()) for tau in grid]
    return _polished(misfit, float(grid[int(np.argmin(costs))]))


def _pairs(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Each picture with the next and the one after it."""
    near, far = np.arange(count - 1), np.arange(count - 2)
    return np.concatenate([near, far]), np.concatenate([near + 1, far + 2])


def _polished(misfit: Callable[[float], FloatArray], start_s: float) -> ClockOffset | None:
    """Gauss-Newton with Huber weights from the best of the grid; None where they show nothing."""
    tau = start_s
    for _ in range(_ROUNDS):
        r = misfit(tau)
        slope = (misfit(tau + _SLOPE_S) - misfit(tau - _SLOPE_S)) / (2 * _SLOPE_S)
        scale = 1.4826 * float(np.median(np.abs(r))) + 1e-9
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(np.abs(r), 1e-12))
        reported = float((weight * slope**2).sum())
        if reported <= 0.0:
            return None
        step = -float((weight * slope * r).sum()) / reported
        tau += float(np.clip(step, -_STEP_S, _STEP_S))
    # every picture takes part in up to four pairs, whose errors go together
    sigma = 2.0 * scale / np.sqrt(reported)
    if sigma > _TELLING_S or abs(tau) > _SPAN_S:
        return None
    return ClockOffset(tau, sigma)
