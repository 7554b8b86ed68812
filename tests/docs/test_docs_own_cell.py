"""docs/howto/your-own-cell.md and docs/board.md: their commands give a board and a usable cell."""

from __future__ import annotations

from pathlib import Path

import pytest

from cell.devices.nominal_cell import nominal
from cell.sequencer.bounded import check_bounded
from cell.storage.files.cell_file import read_cell
from tests.docs.pages import ROOT, blocks, commands, run_command


def test_from_nothing_to_a_board_and_a_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("howto/your-own-cell.md", "board.md"):
        for block in blocks(ROOT / "docs" / name):
            for words in commands(block):
                run_command(words)
    assert (tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")
    cell = read_cell(tmp_path / "bench" / "cell.yaml")
    check_bounded(cell)
    assert nominal(cell).simulation is not None
    assert cell.robot.driver == "ur"
