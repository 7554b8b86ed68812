"""The truth that a cell is simulated with: its own section, else what its layout says."""

from __future__ import annotations

from cell.devices.planned_camera import PlannedCamera
from cell.errors import InputError
from cell.storage.files.cell_file import CellFile, Noise, Simulation

USUAL_NOISE = Noise(corner_px=0.1, arm_position_m=3e-5, arm_rotation_rad=1e-4)
"""A good detector and an arm of this class; taken where the cell file does not state it."""


def nominal(cell: CellFile) -> CellFile:
    """The cell with a `simulation` section: its own, or what its layout says with usual noise."""
    if cell.simulation is not None:
        return cell
    if cell.layout is None:
        raise InputError(
            f"cell {cell.name}: says neither `layout` nor `simulation`, so nobody knows what the"
            " camera sees; measure the layout with a tape"
        )
    alpha = PlannedCamera.of(cell).alpha_px
    u0, v0 = 0.5 * (cell.camera.width - 1), 0.5 * (cell.camera.height - 1)
    optics = {"alpha_px": alpha, "beta_px": alpha, "u0_px": u0, "v0_px": v0}
    truth = Simulation(
        mounted=cell.layout.mounted, fixed=cell.layout.fixed, optics=optics, noise=USUAL_NOISE
    )
    return cell.model_copy(update={"simulation": truth})
