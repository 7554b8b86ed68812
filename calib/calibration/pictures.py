"""What a choice of lens costs the pictures of a recording, each with a free pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.domain import off_axis_rad
from calib.chain.model import Errors, evaluate
from calib.chain.optics import COLUMN
from calib.solver.free_poses import FreePoseFit, fit_free_poses
from calib.solver.joint import JointFit
from calib.solver.unknowns import plain_optics
from calib.views import BoolArray, FloatArray, Views

FOLDS = 5
_PATIENCE = 30
"""Iterations after which the pictures do not fix the terms asked for: a good fit takes ten."""


@dataclass(frozen=True)
class Pictures:
    """N pictures of M corners, and near which camera and poses they were taken.

    Attributes
    ----------
    optics, camera_from_board, points_m:
        (N, K), (N, 4, 4), (M, 3).
    corners_px, weight:
        (N, M, 2), (N, M).
    """

    optics: FloatArray
    camera_from_board: FloatArray
    points_m: FloatArray
    corners_px: FloatArray
    weight: FloatArray

    @classmethod
    def of_joint(cls, joint: JointFit, views: Views) -> Pictures:
        """Those of a joint fit."""
        state = evaluate(joint.model, views, errors=Errors(joint.flange_error))
        return cls(
            state.optics, state.camera_from_board, state.points_m, views.corners_px, joint.weight
        )

    @property
    def observations(self) -> float:
        """How many coordinates count."""
        return 2.0 * float((self.weight > 0.0).sum())

    @property
    def plain(self) -> tuple[str, ...]:
        """Columns that are free with any choice."""
        return plain_optics(self.optics[0])

    @property
    def wide(self) -> bool:
        """Whether the lens is an equidistant one."""
        return bool(self.optics[0, COLUMN["equidistant"]])

    def farthest_rad(self, camera_from_board: FloatArray) -> float:
        """Angle off the axis of the farthest corner that counts, under (N, 4, 4) poses."""
        turn = np.swapaxes(camera_from_board[:, :3, :3], 1, 2)
        angle = off_axis_rad(self.points_m @ turn + camera_from_board[:, None, :3, 3])
        counts = (self.weight > 0.0) & np.isfinite(self.corners_px).all(axis=2)
        return float(angle[counts].max())

    def fit(self, terms: tuple[str, ...]) -> FreePoseFit:
        """All frames."""
        return self._fit(self.optics, slice(None), self.plain + terms)

    def gain(self, without: float, with_: float, group: tuple[str, ...]) -> float:
        """By how much a group lowers the criterion; the two are weighted square sums."""
        return float(
            self.observations * np.log(without / with_) - len(group) * np.log(self.observations)
        )

    def square_sum(self, fit: FreePoseFit) -> float:
        """Weighted square sum of a fit to all frames."""
        return float(np.nansum(self.weight * np.sum(fit.residual_px**2, axis=2)))

    def held_out(self, terms: tuple[str, ...]) -> float:
        """Weighted square sum of frames that had no say in the lens, only in their own pose."""
        fold = np.arange(len(self.weight)) % FOLDS
        total = 0.0
        for k in range(FOLDS):
            lens = self._fit(self.optics, fold != k, self.plain + terms)
            if not lens.converged:
                return np.inf
            optics = self.optics.copy()
            columns = [COLUMN[name] for name in self.plain + terms]
            optics[:, columns] += lens.optics[0, columns] - self.optics[fold != k][0, columns]
            alone = self._fit(optics, fold == k, ())
            square = np.sum(alone.residual_px**2, axis=2)
            total += float(np.nansum(self.weight[fold == k] * square))
        return total

    def _fit(
        self, optics: FloatArray, frames: BoolArray | slice, free: tuple[str, ...]
    ) -> FreePoseFit:
        return fit_free_poses(
            optics[frames],
            self.camera_from_board[frames],
            self.points_m,
            self.corners_px[frames],
            free,
            weight=self.weight[frames],
            max_iterations=_PATIENCE,
        )
