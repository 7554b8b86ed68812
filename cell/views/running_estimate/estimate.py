"""One estimate: the joint fit of the frames so far, and what it says of the scale factor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.calibration.running import RunningFit, fit_so_far
from calib.detection.same_order import same_order_everywhere
from calib.errors import CalibrationError
from calib.views import FloatArray, Views
from cell.sequencer.session import header_of
from cell.storage.files.plan_file import Plan
from cell.storage.recording import Corners, FrameRecord, Recording
from cell.views.running_estimate.view_kinds import Sights, lacking

FEWEST_FRAMES = 5
_DISTANCES = 5


@dataclass(frozen=True)
class Transforms:
    """(4, 4) flange_from_mounted and base_from_fixed, as in `calib.chain.model.CellModel`."""

    flange_from_mounted: FloatArray
    base_from_fixed: FloatArray


@dataclass(frozen=True)
class Estimate:
    """What the frames so far say.

    Attributes
    ----------
    frames, used:
        How many were looked at, and how many took part.
    missing:
        Why there is no fit yet, as text; empty where there is one.
    distance_m, alpha_px, sigma_px:
        (D,) the planned distances' range, the scale factor there, one sigma of it; empty without
        a fit.
    lacks:
        What the plan has and the frames do not yet, see `view_kinds.lacking`.
    transforms:
        Where camera and board are, or None.
    """

    frames: int
    used: int
    missing: str
    distance_m: FloatArray
    alpha_px: FloatArray
    sigma_px: FloatArray
    lacks: tuple[str, ...]
    transforms: Transforms | None

    @classmethod
    def none(cls, frames: int, why: str) -> Estimate:
        """No fit yet."""
        return cls(frames, 0, why, np.zeros(0), np.zeros(0), np.zeros(0), (), None)

    @property
    def worst_sigma_px(self) -> float:
        """The largest sigma over the planned distances; infinite without a fit."""
        return float(self.sigma_px.max(initial=0.0)) if self.sigma_px.size else float("inf")


class Estimator:
    """Collects frames and estimates when asked.

    Parameters
    ----------
    plan, planned_poses:
        The run's plan; (V, 4, 4) base_from_flange of its views, which say what distances and tilts
        are wanted.
    """

    def __init__(self, plan: Plan, planned_poses: FloatArray) -> None:
        self._plan, self._planned = plan, planned_poses
        self._frames: dict[int, FrameRecord] = {}
        self._px: dict[int, FloatArray] = {}
        self._sigma_px: dict[int, FloatArray] = {}

    def __len__(self) -> int:
        return len(self._frames)

    def add(self, record: FrameRecord, corners_px: FloatArray, sigma_px: FloatArray) -> None:
        """One more frame, its (M, 2) corners and their (M,) sigma."""
        self._frames[record.frame] = record
        self._px[record.frame] = corners_px
        self._sigma_px[record.frame] = sigma_px

    def estimate(self, frames: int | None = None) -> Estimate:
        """Fit the first `frames` of them, or all."""
        chosen = tuple(self._frames.values())[:frames]
        if len(chosen) < FEWEST_FRAMES:
            return Estimate.none(
                len(chosen), f"{len(chosen)} frames; {FEWEST_FRAMES} are the least"
            )
        try:
            fit = fit_so_far(
                self._views(chosen), lens_moves=self._plan.file.exposure.focus == "auto"
            )
        except CalibrationError as error:
            return Estimate.none(len(chosen), str(error))
        return self._estimate(len(chosen), fit)

    def _views(self, chosen: tuple[FrameRecord, ...]) -> Views:
        numbers = [frame.frame for frame in chosen]
        px: Mapping[int, FloatArray] = {n: self._px[n] for n in numbers}
        sigma_px = {n: self._sigma_px[n] for n in numbers}
        header = header_of(self._plan, simulated=False)
        recording = Recording(Path(), header, chosen)
        return same_order_everywhere(recording.views(Corners(px, sigma_px)))

    def _estimate(self, frames: int, fit: RunningFit) -> Estimate:
        board = self._plan.cell.board.board()
        planned = Sights.of(fit.camera_from_board(self._planned), board)
        logged = fit.views.base_from_flange[fit.taken]
        seen = Sights.of(fit.camera_from_board(logged), board)
        distance_m = np.geomspace(planned.distance_m.min(), planned.distance_m.max(), _DISTANCES)
        alpha_px, sigma_px = fit.alpha_over(distance_m)
        model = fit.joint.model
        return Estimate(
            frames,
            int(fit.taken.sum()),
            "",
            distance_m,
            alpha_px,
            sigma_px,
            lacking(planned, seen),
            Transforms(model.flange_from_mounted, model.base_from_fixed),
        )
