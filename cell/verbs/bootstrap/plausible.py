"""Whether what was seen can be the cell that the layout describes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain import rigid
from calib.chain.model import CellModel
from calib.solver.joint import JointFit
from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.files.cell_file import CellFile, Layout
from cell.verbs.bootstrap.layout_uncertainty import LayoutUncertainty

_AXIS_RAD = float(np.radians(45.0))
_FAR_OFF = 3.0
_BAD_PX = 10.0
"""A lens with distortion leaves a pixel or two; a wrong chain leaves hundreds."""


def check_place(
    cell: CellFile,
    layout: Layout,
    seen: CellModel,
    distance_m: float,
    uncertainty: LayoutUncertainty,
) -> None:
    """Raise `InputError` where the first picture puts the fixed part elsewhere than the layout."""
    what = "board" if cell.mount == "eye_in_hand" else "camera"
    fixed = layout.fixed.transform().as_matrix()
    centre = np.zeros(3)
    if cell.mount == "eye_in_hand":
        centre = cell.board.board().corners_m.mean(axis=0)
    off_m = float(np.linalg.norm(_point(seen.base_from_fixed, centre) - _point(fixed, centre)))
    bound_m = (
        uncertainty.fixed_m
        + uncertainty.mount_m
        + distance_m * (uncertainty.mount_rad + uncertainty.alpha_share)
    )
    if off_m > bound_m:
        raise InputError(
            f"cell {cell.name}: layout: from here the picture puts the {what} {off_m:.2f} m from"
            f" `layout.fixed`; {bound_m:.2f} m could be explained. Correct layout.fixed,"
            " layout.mounted, board.square_m or layout.alpha_px; the arm is not moved on such a"
            " guess."
        )
    axes = float(np.arccos(np.clip(seen.base_from_fixed[:3, 2] @ fixed[:3, 2], -1.0, 1.0)))
    if axes > _AXIS_RAD:
        raise InputError(
            f"cell {cell.name}: layout: from here the picture shows the {what}'s z axis turned by"
            f" {np.degrees(axes):.0f}° against `layout.fixed`. Is layout.mounted or layout.fixed"
            " the wrong way round, or turned by a quarter? The arm is not moved on such a guess."
        )


def check_moves(
    cell: CellFile, guess: FloatArray, fit: JointFit, uncertainty: LayoutUncertainty
) -> None:
    """Raise `InputError` where the board did not move in the picture as the arm was moved."""
    off = rigid.inverse(guess) @ fit.model.flange_from_mounted
    off_m = float(np.linalg.norm(off[:3, 3]))
    off_rad = float(Rotation.from_matrix(off[:3, :3]).magnitude())
    rms_px = float(np.sqrt(np.nanmean(fit.residual_px**2)))
    near = off_m < _FAR_OFF * uncertainty.mount_m and off_rad < _FAR_OFF * uncertainty.mount_rad
    if near and rms_px < _BAD_PX:
        return
    raise InputError(
        f"cell {cell.name}: layout.mounted: the board does not move in the picture as the arm"
        f" moves: the best fit misses it by {rms_px:.1f} px with {1e3 * off_m:.0f} mm and"
        f" {np.degrees(off_rad):.0f}° off `layout.mounted`. Check the mount (eye_in_hand or"
        " eye_to_hand), the axes of layout.mounted, and that the board stands fast."
    )


def _point(a_from_b: FloatArray, point_m: FloatArray) -> FloatArray:
    return np.asarray(a_from_b[:3, :3] @ point_m + a_from_b[:3, 3])
