"""A motorised lens goes through its positions in one plan: planned, driven, logged, simulated."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from cell.errors import InputError
from cell.storage.files.cell_file import read_cell
from cell.storage.files.plan_file import PlanFile, read_plan
from cell.storage.files.writing import yaml_text
from cell.storage.recording import read_recording
from cell.verbs.init.answers import Answers
from cell.verbs.init.cell_text import cell_of
from cell.verbs.plan import PlanSize, design_plan
from tests.cell.plans import CELL, PLAN
from tests.cell.test_cli import Cell
from tests.cell.test_cli import cell as cell  # a fixture

POSITIONS = (700.0, 760.0, 820.0)
CHESS = {"type": "chessboard", "rows": 4, "cols": 5, "square_m": 0.03}
ANSWERS = Answers(
    board=CHESS, size_px=(640, 480), pixel_size_um=5.0, focal_length_mm=4.0, focus="motorised"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("swept")


@pytest.fixture(scope="module")
def swept(folder: Path) -> PlanFile:
    bench = cell_of(ANSWERS)
    camera = bench.camera.model_copy(update={"focus_positions": POSITIONS})
    bench = bench.model_copy(update={"camera": camera})
    (folder / "bench.yaml").write_text(yaml_text(bench.as_mapping()))
    size = PlanSize(parallel=3, varied=6, by_hand=True)
    plan = design_plan(bench, size, cell_path="bench.yaml")
    (folder / "plan.yaml").write_text(yaml_text(plan.as_mapping()))
    return plan


def test_each_position_has_views_of_both_kinds(swept: PlanFile) -> None:
    assert swept.exposure.focus == "position"
    kinds = Counter((view.station, view.focus_position) for view in swept.views)
    assert kinds == {(s, p): n for s, n in (("parallel", 1), ("varied", 2)) for p in POSITIONS}


def test_the_lens_goes_to_each_view_s_position_and_it_is_logged(
    swept: PlanFile, folder: Path, cell: Cell, tmp_path: Path
) -> None:
    asked = [view.focus_position for view in swept.views]
    done = cell("run", folder / "plan.yaml", "--dry-run", "--record-only", "-o", tmp_path / "run")
    assert done.status == 0, done.err
    assert cell("simulate", folder / "plan.yaml", "-o", tmp_path / "corners").status == 0
    for name in ("run", "corners"):
        frames = read_recording(tmp_path / name).frames
        assert [frame.focus_position for frame in frames] == asked, name
        share = 1.0 - np.array(asked) / 1023
        focused_m = [frame.focus_distance_m for frame in frames]
        np.testing.assert_allclose(focused_m, 0.1 / share, rtol=1e-6, err_msg=name)


def test_a_position_that_is_missing_is_named(tmp_path: Path) -> None:
    (tmp_path / "bench.yaml").write_text(CELL)
    text = PLAN.replace("first, ", "first, focus_position: 700, ")
    (tmp_path / "plan.yaml").write_text(text + "exposure: {focus: position}\n")
    with pytest.raises(InputError, match=r"views\.1 has none"):
        read_plan(tmp_path / "plan.yaml")
    (tmp_path / "bench.yaml").write_text(CELL.replace("5.0}", "5.0, focus_positions: [1]}"))
    with pytest.raises(InputError, match="needs focus: motorised"):
        read_cell(tmp_path / "bench.yaml")
