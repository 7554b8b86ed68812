"""Where in the image, at which distances and tilts: as planned, and as seen."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.handeye import chain
from calib.views import FloatArray
from cell.devices.planned_camera import PlannedCamera
from cell.errors import InputError
from cell.sequencer.watcher import Checked
from cell.storage.files.plan_file import Plan
from cell.views.running_estimate.estimate import Transforms
from cell.views.running_estimate.view_kinds import Sights, planned_flange_poses

COLUMNS, ROWS = 8, 6


@dataclass
class Coverage:
    """The coverage of one run.

    Attributes
    ----------
    plan, sight:
        The plan, and what its camera sees; None where nothing states its scale factor.
    planned_poses:
        (V, 4, 4) base_from_flange.
    transforms:
        Where camera and board are: by the tape measure, later by the estimate; None while unknown.
    """

    plan: Plan
    sight: PlannedCamera | None
    planned_poses: FloatArray
    transforms: Transforms | None
    _seen_poses: dict[int, FloatArray] = field(default_factory=dict)
    _cells: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((ROWS, COLUMNS), dtype=np.int64)
    )

    @classmethod
    def of(cls, plan: Plan) -> Coverage:
        """Nothing seen yet."""
        layout = plan.cell.layout
        transforms = None
        if layout is not None:
            mounted, fixed = layout.mounted.transform(), layout.fixed.transform()
            transforms = Transforms(mounted.as_matrix(), fixed.as_matrix())
        try:
            sight = PlannedCamera.of(plan.cell)
        except InputError:
            sight = None
        return cls(plan, sight, planned_flange_poses(plan), transforms)

    def see(self, checked: Checked) -> None:
        """Count a frame that was kept."""
        record, found = checked.record, checked.verdict.detection
        if record is None or record.base_from_flange is None:
            return
        self._seen_poses[record.frame] = record.base_from_flange.transform().as_matrix()
        if found is not None:
            height, width = checked.shot.frame.image.shape[:2]
            self._cells = self._cells + _cells_of(found.corners_px, width, height)

    def place(self, transforms: Transforms) -> None:
        """The estimate knows better where camera and board are."""
        self.transforms = transforms

    def content(self) -> dict[str, Any]:
        """The part of the page."""
        planned = self._from_board(self.planned_poses)
        seen = self._from_board(np.array(list(self._seen_poses.values())))
        return {
            "columns": COLUMNS,
            "rows": ROWS,
            "planned_cells": self._planned_cells(planned).ravel().tolist(),
            "seen_cells": self._cells.ravel().tolist(),
            "planned": self._places(planned),
            "seen": self._places(seen),
            "seen_views": list(self._seen_poses),
        }

    def _from_board(self, poses: FloatArray) -> FloatArray | None:
        if self.transforms is None or not len(poses):
            return None
        mounted, fixed = self.transforms.flange_from_mounted, self.transforms.base_from_fixed
        return chain(self.plan.cell.mount, mounted, poses, fixed)

    def _places(self, camera_from_board: FloatArray | None) -> list[list[float]]:
        """[distance m, tilt °, direction °] of each view; the same order as the poses."""
        if camera_from_board is None:
            return []
        s = Sights.of(camera_from_board, self.plan.cell.board.board())
        rows = np.stack([s.distance_m, np.degrees(s.tilt_rad), np.degrees(s.direction_rad)], 1)
        return [[round(x, 3) for x in row] for row in rows.tolist()]

    def _planned_cells(self, camera_from_board: FloatArray | None) -> NDArray[np.int64]:
        """(ROWS, COLUMNS) in how many planned views a corner falls into that part of the image."""
        cells = np.zeros((ROWS, COLUMNS), dtype=np.int64)
        if camera_from_board is None or self.sight is None:
            return cells
        width, height = self.sight.width_px, self.sight.height_px
        for pose in camera_from_board:
            x, y, z = (pose[:3, :3] @ self.sight.board.corners_m.T) + pose[:3, 3:]
            ahead = z > 0
            rays = np.stack([x[ahead], y[ahead]], 1) / z[ahead, None]
            pixels = self.sight.alpha_px * rays + np.array([width, height]) / 2
            cells += _cells_of(pixels, width, height)
        return cells


def _cells_of(pixels: FloatArray, width_px: int, height_px: int) -> NDArray[np.int64]:
    """(ROWS, COLUMNS) one where any of the (M, 2) pixels falls."""
    inside = pixels[np.isfinite(pixels).all(axis=1)]
    found = np.histogram2d(
        inside[:, 1], inside[:, 0], bins=(ROWS, COLUMNS), range=((0, height_px), (0, width_px))
    )[0]
    return (found > 0).astype(np.int64)
