"""A length that somebody else measured, measured again with the old calibration.

Its two ends are triangulated from several robot poses, so neither the board's drawing nor its place
has a say in it. Measured less known is what VDI/VDE 2634 Part 1 and ISO 10360 call the error of
length measurement; one length at one place is evidence and no acceptance test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.model import CellModel, Errors, evaluate
from calib.chain.projection import project, project_with_jacobians
from calib.chain.rigid import inverse
from calib.distributions import normal_tail
from calib.solver.unknowns import moved
from calib.views import BoolArray, FloatArray, Views
from cell.errors import InputError
from cell.verbs.verify.judge import SIGNIFICANT, Judgement
from cell.verbs.verify.misfit import Misfit, camera_roots
from cell.verbs.verify.old_cell import OldCell

_FRAMES_NEEDED = 3
_STEPS = 20


@dataclass(frozen=True)
class KnownLength:
    """A length between two corners.

    Attributes
    ----------
    length_m, sigma_m:
        As measured by other means, and one sigma of that.
    corners:
        (row, col) of both ends.
    """

    length_m: float
    sigma_m: float
    corners: tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class LengthFound:
    """What the old calibration makes of a known length.

    Attributes
    ----------
    known:
        The length.
    frames:
        How many poses it was seen from.
    measured_m, error_m, sigma_m:
        Measured; measured less known; one sigma of that error, the known length's own included.
    p_value:
        Of an error as large by chance.
    """

    known: KnownLength
    frames: int
    measured_m: float
    error_m: float
    sigma_m: float
    p_value: float

    @property
    def wrong(self) -> bool:
        """Whether the error is more than chance."""
        return self.p_value < SIGNIFICANT


def measure(old: OldCell, found: Judgement, misfit: Misfit, known: KnownLength) -> LengthFound:
    """Measure a known length with the old camera and the robot's poses.

    Raises
    ------
    InputError
        The board has no such corners, or too few frames show both.
    """
    views = found.views
    ends = [_index(views, corner) for corner in known.corners]
    if ends[0] == ends[1]:
        raise InputError("--corners: both ends are the same corner")
    both: BoolArray = np.asarray((found.weight[:, ends] > 0).all(axis=1))
    if both.sum() < _FRAMES_NEEDED:
        raise InputError(
            f"--corners: {int(both.sum())} frames show both corners; {_FRAMES_NEEDED} are needed"
        )
    seen = _Seen(old, misfit.model, views.take(both), np.array(ends), found)
    points = seen.triangulate()
    along = points[0] - points[1]
    measured = float(np.linalg.norm(along))
    variance = seen.variance(points, along / measured) + known.sigma_m**2
    error, sigma = measured - known.length_m, float(np.sqrt(variance))
    p_value = 2 * normal_tail(abs(error) / sigma)
    return LengthFound(known, int(both.sum()), measured, error, sigma, p_value)


def _index(views: Views, corner: tuple[int, int]) -> int:
    row, col = corner
    board = views.board
    if not (0 <= row < board.rows and 0 <= col < board.cols):
        raise InputError(
            f"--corners: {row},{col} is not on the board: rows 0 to {board.rows - 1}, columns 0 to"
            f" {board.cols - 1}"
        )
    return row * board.cols + col


class _Seen:
    """Both ends in all frames that show them."""

    def __init__(
        self,
        old: OldCell,
        model: CellModel,
        views: Views,
        ends: np.ndarray[tuple[int], np.dtype[np.int64]],
        found: Judgement,
    ) -> None:
        self.old, self.model, self.views = old, model, views
        self.noise = found.noise
        self.pixels = views.corners_px[:, ends]
        state = evaluate(model, views)
        on_board = state.points_m[ends]
        place = state.base_from_board[0] if state.in_hand else state.flange_from_mounted[0]
        self.start = on_board @ place[:3, :3].T + place[:3, 3]
        self.weight = self._weight(state.optics[:, 0], state.distance_m)

    def _weight(self, alpha_px: FloatArray, distance_m: FloatArray) -> FloatArray:
        """(N,) inverse variance of an end's pixel: its noise, and the arm's scatter in it."""
        noise = self.noise
        by_arm = (alpha_px * noise.flange_rad) ** 2 + (alpha_px * noise.flange_m / distance_m) ** 2
        return np.asarray(1.0 / (noise.corner_px**2 + by_arm))

    def cameras(
        self, model: CellModel, flange_error: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """(N, K) optics, and (N, 4, 4) cameras from the frame in which the board stands still."""
        state = evaluate(model, self.views, errors=Errors(flange_error))
        if state.in_hand:
            return state.optics, inverse(state.base_from_camera)
        return state.optics, inverse(state.base_from_fixed) @ state.base_from_flange

    def triangulate(self) -> FloatArray:
        """(2, 3) both ends, by weighted least squares in pixels."""
        optics, cameras = self.cameras(self.model)
        points: FloatArray = self.start
        for _ in range(_STEPS):
            J, off = self._linear(optics, cameras, points)
            step = np.array([self._solve(J[:, k], off[:, k]) for k in (0, 1)])
            points = np.asarray(points + step, dtype=np.float64)
            if np.abs(step).max() < 1e-10:
                break
        return points

    def _linear(
        self, optics: FloatArray, cameras: FloatArray, points: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(N, 2, 2, 3) pixels by the points, and (N, 2, 2) seen minus predicted."""
        pixels, by_pose, _ = project_with_jacobians(optics, cameras, points)
        by_point: FloatArray = np.asarray(by_pose[..., :3] @ cameras[:, None, :3, :3])
        return by_point, self.pixels - pixels

    def _solve(self, J: FloatArray, off: FloatArray) -> FloatArray:
        """(3, ...) step of one end for (N, 2, ...) pixels."""
        W = np.repeat(self.weight, 2)
        A = J.reshape(-1, 3)
        right = (A * W[:, None]).T @ off.reshape(len(A), -1)
        solved = np.linalg.solve((A * W[:, None]).T @ A, right)
        return np.asarray(solved.reshape(3, *off.shape[2:]))

    def variance(self, points: FloatArray, along: FloatArray) -> float:
        """Of the length: old numbers, arm, and corners."""
        optics, cameras = self.cameras(self.model)
        J, _ = self._linear(optics, cameras, points)
        total = 0.0
        for change in self._by_old_numbers(points):
            total += self._length(J, change, along) ** 2
        for change in self._by_arm(points):  # each frame's arm is off by itself
            for frame in range(len(change)):
                alone = np.zeros_like(change)
                alone[frame] = change[frame]
                total += self._length(J, alone, along) ** 2
        W = np.repeat(self.weight, 2)
        for end in (0, 1):
            A = J[:, end].reshape(-1, 3)
            gain = along @ np.linalg.solve((A * W[:, None]).T @ A, (A * W[:, None]).T)
            total += float(gain @ gain) * self.noise.corner_px**2
        return total

    def _length(self, J: FloatArray, change: FloatArray, along: FloatArray) -> float:
        ends = [self._solve(J[:, k], -change[:, k]) for k in (0, 1)]
        return float(along @ (ends[0] - ends[1]))

    def _by_old_numbers(self, points: FloatArray) -> list[FloatArray]:
        found = []
        for root in camera_roots(self.old):
            ahead, behind = (
                project(*self.cameras(moved(self.model, self.old.unknowns, s * root)), points)
                for s in (1.0, -1.0)
            )
            found.append((ahead - behind) / 2)
        return found

    def _by_arm(self, points: FloatArray) -> list[FloatArray]:
        found = []
        for k, size in enumerate([self.noise.flange_m] * 3 + [self.noise.flange_rad] * 3):
            error = np.zeros((len(self.views), 6))
            error[:, k] = size
            ahead, behind = (project(*self.cameras(self.model, e), points) for e in (error, -error))
            found.append((ahead - behind) / 2)
        return found
