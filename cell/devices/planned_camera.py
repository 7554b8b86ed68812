"""The camera as a plan assumes it: which views of the board are whole in the image."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.views import Board, BoolArray, FloatArray
from cell.errors import InputError
from cell.storage.files.cell_file import CellFile

_EDGE = 0.03
"""Share of the image kept free along every edge: the layout is known to a centimetre or two."""


@dataclass(frozen=True)
class PlannedCamera:
    """What the planned camera sees of the board.

    Attributes
    ----------
    board, width_px, height_px, alpha_px:
        The target, and a pinhole good enough to plan with.
    """

    board: Board
    width_px: int
    height_px: int
    alpha_px: float

    @classmethod
    def of(cls, cell: CellFile) -> PlannedCamera:
        """The sight of a cell; raises `InputError` where nothing states its scale factor."""
        camera = cell.camera
        alpha_px = cell.layout.alpha_px if cell.layout else None
        if alpha_px is None and camera.lens and camera.pixel_size_um:
            alpha_px = 1e3 * camera.lens.focal_length_mm / camera.pixel_size_um
        if alpha_px is None:
            raise InputError(
                f"cell {cell.name}: to plan poses one must know what the camera sees: write"
                " layout.alpha_px, or camera.lens.focal_length_mm and camera.pixel_size_um"
            )
        return cls(cell.board.board(), camera.width, camera.height, alpha_px)

    @cached_property
    def _outline_m(self) -> FloatArray:
        """(4, 3) corners of the board and half a square around, from the board's centre."""
        corners = self.board.corners_m
        border = 0.5 * self.board.square_m
        low, high = corners.min(axis=0) - border, corners.max(axis=0) + border
        outline = [[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])]
        return np.asarray(np.array(outline) - corners.mean(axis=0))

    def whole(self, turn: Rotation, centre_m: FloatArray) -> BoolArray:
        """(...) whether board and half a square around are in the image, its centre at (..., 3)."""
        x, y, z = np.moveaxis(turn.apply(self._outline_m) + centre_m[..., None, :], -1, 0)
        half = 0.5 - _EDGE
        across = np.abs(self.alpha_px * x) <= half * self.width_px * z
        down = np.abs(self.alpha_px * y) <= half * self.height_px * z
        return np.asarray((across & down & (z > 0)).all(axis=-1))

    def placed(self, turn: Rotation, centre_m: FloatArray) -> RigidTransform:
        """camera_from_board with the board's centre there."""
        shift = centre_m - turn.apply(self.board.corners_m.mean(axis=0))
        return RigidTransform.from_components(shift, turn)
