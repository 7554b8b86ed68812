"""The cell as one may think of it before anything is recorded: its lens, its place, its noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.chain.effect import Present
from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.solver.noise import Noise
from calib.views import FloatArray, Views
from cell.devices.nominal_cell import USUAL_NOISE, nominal
from cell.devices.simulated_cell import simulated_cell
from cell.storage.files.cell_file import CellFile
from cell.verbs.plan.reach import layout_of
from sim.cell import SimulatedCell

_STANDS = ("fixed", "manual")


def assumed_noise(cell: CellFile) -> tuple[Noise, str]:
    """Noise levels to plan with, and where they are from."""
    reported = cell.simulation.noise if cell.simulation else USUAL_NOISE
    noise = Noise(
        corner_px=reported.corner_px or USUAL_NOISE.corner_px,
        flange_m=reported.arm_position_m or USUAL_NOISE.arm_position_m,
        flange_rad=reported.arm_rotation_rad or USUAL_NOISE.arm_rotation_rad,
    )
    if cell.simulation is None:
        return noise, "assumed; the cell file does not state it"
    levels = (reported.corner_px, reported.arm_position_m, reported.arm_rotation_rad)
    return noise, "simulation.noise" if all(levels) else "simulation.noise, zeros as usual"


@dataclass(frozen=True)
class Assumed:
    """What views are judged by before they are taken.

    Attributes
    ----------
    cell:
        As file and layout state it, without effects.
    model:
        Its chain.
    lens:
        The focus law that is fitted as well: a thin lens's, or none where the focus stands still.
        An error in the camera's place along the axis looks much like it, so views that settle it
        settle the other laws.
    noise, noise_from:
        Noise levels, and where they are from.
    """

    cell: SimulatedCell
    model: CellModel
    lens: tuple[Present, ...]
    noise: Noise
    noise_from: str

    @property
    def whole(self) -> CellModel:
        """The chain with the focus law."""
        return self.model.with_effects(self.lens)

    def views(self, base_from_flange: Sequence[FloatArray]) -> Views:
        """Views at (4, 4) flange poses; each frame focused at the board."""
        blank = Views.blank(
            self.cell.board,
            width_px=self.cell.camera.width_px,
            height_px=self.cell.camera.height_px,
            frames=len(base_from_flange),
            mount=self.cell.mount,
        )
        return replace(blank, base_from_flange=np.array(base_from_flange).reshape(-1, 4, 4))


def assume(cell: CellFile) -> Assumed:
    """Say what is assumed of a cell with a layout; raises `InputError`."""
    home = np.radians(layout_of(cell).home_deg)
    simulated = simulated_cell(nominal(cell), home)
    moves = cell.camera.focus not in _STANDS
    lens = (make_effect("focus_breathing", {"law": "thin_lens"}),) if moves else ()
    noise, noise_from = assumed_noise(cell)
    return Assumed(simulated, simulated.model.with_effects(()), lens, noise, noise_from)
