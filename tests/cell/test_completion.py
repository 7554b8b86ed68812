"""What Tab completes in the shell: verbs, options, formats."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from cell.cli.app import VERBS, app


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("cell ", set(VERBS)),
        ("cell ca", {"calibrate"}),
        ("cell run --re", {"--resume", "--record-only"}),
        ("cell export runs/monday --format u", {"urdf", "ur"}),
        ("cell import pictures --mount eye_to", {"eye_to_hand"}),
    ],
)
def test_tab_completes(typed: str, completed: set[str]) -> None:
    words = typed.split()
    asked = {
        "_CELL_COMPLETE": "complete_bash",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(len(words) - (not typed.endswith(" "))),
    }
    done = CliRunner().invoke(app, [], prog_name="cell", env=asked)
    assert set(done.output.split()) == completed
