"""What is installed, reachable and ready, and how to mend what is not."""

from __future__ import annotations

from cell.doctor.finding import Finding
from cell.doctor.installed import installed
from cell.doctor.reachable import reachable
from cell.files.cell_file import CellFile

__all__ = ["Finding", "examine"]


def examine(cell: CellFile | None = None) -> list[Finding]:
    """Look at this machine, and at a cell's devices where one is given; moves nothing."""
    findings = installed(cell)
    return findings if cell is None else findings + reachable(cell)
