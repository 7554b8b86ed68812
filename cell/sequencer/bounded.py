"""Whether a cell says where its arm may go; no real arm moves where it does not."""

from __future__ import annotations

from cell.storage.files.cell_file import CellFile
from drivers.errors import SafetyError


def check_bounded(cell: CellFile) -> None:
    """Raise `SafetyError` for a cell whose file leaves out what its arm could run into."""
    missing = []
    if cell.workspace is None and cell.no_workspace_because is None:
        missing.append(
            "`workspace`, the box that the arm stays inside; or, where there is truly nothing to"
            " run into, neither floor nor table, write why: `no_workspace_because: ...`"
        )
    if not cell.states_keep_out:
        missing.append(
            "`keep_out`, the boxes that it stays out of; `keep_out: []` where there are none"
        )
    if missing:
        raise SafetyError(
            f"cell {cell.name}: a real arm is not moved without {'; and without '.join(missing)}."
            " Measure them with a tape, in the robot base."
        )
