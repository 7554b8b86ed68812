"""A guard that allows for what is not known, and keeps the arm near the pose it started from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from calib.bodies import Scene
from calib.chain import rigid
from calib.views import FloatArray
from cell.errors import InputError
from cell.sequencer.bodies import doubtful_scene_of, outline_m
from cell.sequencer.guard import Guard
from cell.storage.files.cell_file import CellFile
from cell.storage.files.parts import Box
from cell.verbs.bootstrap.layout_uncertainty import LayoutUncertainty
from drivers.errors import SafetyError

SPEED_M_S = 0.05
JOINT_SPEED_DEG_S = 10.0
FARTHEST_M = 0.15
FARTHEST_RAD = float(np.radians(25.0))
TRAVEL_RAD = np.radians([25.0, 25.0, 25.0, 60.0, 60.0, 60.0])
"""The wrist turns far for small tilts; the arm itself hardly moves."""


@dataclass(frozen=True)
class NearGuard(Guard):
    """Refuses whatever leads away from where the arm stood.

    Attributes
    ----------
    start_rad:
        (6,) where it stood.
    uncertainty_m:
        How far what hangs on the flange may be from where the layout has it.
    """

    start_rad: FloatArray
    uncertainty_m: float

    @classmethod
    def around(
        cls, cell: CellFile, start_rad: FloatArray, uncertainty: LayoutUncertainty
    ) -> NearGuard:
        """The guard of a cell whose layout is off by no more than stated; raises `InputError`."""
        joint_speed = float(np.radians(JOINT_SPEED_DEG_S))
        return cls(
            cell, SPEED_M_S, joint_speed, start_rad, carried_uncertainty_m(cell, uncertainty)
        )

    @cached_property
    def scene(self) -> Scene:
        """The cell's bodies, what hangs on the flange larger by what it may be off."""
        return doubtful_scene_of(self.cell, self.kinematics, self.uncertainty_m)

    def with_box(self, box: Box) -> NearGuard:
        """The same guard, kept out of one box more."""
        cell = self.cell.model_copy(update={"keep_out": (*self.cell.keep_out, box)})
        return replace(self, cell=cell)

    def check_surroundings(self) -> None:
        """Raise `SafetyError` where the arm stands too near to a box to be moved at all."""
        self.check_start(self.start_rad)
        try:
            self.check_move(self.start_rad, self.start_rad, "where the arm stands")
        except SafetyError as refusal:
            raise SafetyError(
                f"{refusal} What hangs on the flange is taken larger by what the layout may be"
                " off; drive the arm away by hand, or give a better known layout."
            ) from None

    def check_move(self, start_rad: FloatArray, end_rad: FloatArray, where: str) -> None:
        """Raise `SafetyError` where boxes, limits or the neighbourhood refuse the move."""
        path = self.path(start_rad, end_rad)
        if (np.abs(path - self.start_rad) > TRAVEL_RAD + 1e-6).any():
            raise SafetyError(f"{where}: a joint would turn too far from where the arm stood")
        poses = self.kinematics.forward(np.vstack([self.start_rad, path]))
        away = rigid.inverse(poses[:1]) @ poses[1:]
        moved_m = float(np.linalg.norm(away[:, :3, 3], axis=1).max())
        turned_rad = float(Rotation.from_matrix(away[:, :3, :3]).magnitude().max())
        if moved_m > FARTHEST_M + 1e-6 or turned_rad > FARTHEST_RAD + 1e-6:
            raise SafetyError(
                f"{where}: the flange would go {1e3 * moved_m:.0f} mm and"
                f" {np.degrees(turned_rad):.0f}° from where it stood; a bootstrap stays within"
                f" {1e3 * FARTHEST_M:.0f} mm and {np.degrees(FARTHEST_RAD):.0f}°"
            )
        super().check_move(start_rad, end_rad, where)


def carried_uncertainty_m(cell: CellFile, uncertainty: LayoutUncertainty) -> float:
    """How far any point of what hangs on the flange may be from where the layout has it.

    Raises
    ------
    InputError
        The workspace is too small for that.
    """
    carried = outline_m(cell.board.board()) if cell.mount == "eye_to_hand" else np.zeros((1, 3))
    reach_m = float(np.linalg.norm(carried, axis=1).max())
    uncertainty_m = uncertainty.mount_m + reach_m * 2.0 * float(np.sin(0.5 * uncertainty.mount_rad))
    if cell.layout is None:  # what is at the flange may point anywhere
        uncertainty_m = uncertainty.reach_m + reach_m
    space = cell.workspace
    if space is not None and min(np.subtract(space.high_m, space.low_m)) <= 2 * uncertainty_m:
        raise InputError(
            f"cell {cell.name}: workspace: nothing is left of it for what is on the flange, which"
            f" may be {1e3 * uncertainty_m:.0f} mm off on every side"
        )
    return uncertainty_m
