"""What is installed, reachable and ready, and how to mend what is not."""

from __future__ import annotations

from cell.storage.files.cell_file import CellFile
from cell.verbs.doctor.described import described
from cell.verbs.doctor.finding import Finding
from cell.verbs.doctor.installed import installed
from cell.verbs.doctor.reachable import reachable

__all__ = ["Finding", "examine"]


def examine(cell: CellFile | None = None) -> list[Finding]:
    """Look at this machine, and at a cell's devices where one is given; moves nothing."""
    findings = installed(cell)
    return findings if cell is None else [*findings, *described(cell), *reachable(cell)]
