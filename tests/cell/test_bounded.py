"""A real arm is moved only where its cell says where it may go."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from cell.devices.factory import real_devices
from cell.errors import InputError
from cell.storage.files.cell_file import read_cell
from cell.storage.files.plan_file import read_plan
from cell.storage.files.writing import yaml_text
from drivers.errors import SafetyError
from tests.cell.plans import CELL, PLAN

REAL = CELL.replace("{driver: sim, model: ur5e}", "{driver: ur, model: ur5e, address: 127.0.0.9}")
REAL = re.sub("camera: .*", "camera: {driver: gige, model: m, width: 640, height: 480,"
              " address: 127.0.0.8}", REAL)  # fmt: skip
WORKSPACE = re.search("workspace: .*\n", REAL)[0]  # type: ignore[index]
KEEP_OUT = REAL[REAL.index("keep_out:") :]
WHY = "no_workspace_because: the arm hangs in the middle of an empty hall\n"


def opened(folder: Path, cell: str) -> None:
    (folder / "bench.yaml").write_text(cell)
    (folder / "plan.yaml").write_text(PLAN)
    real_devices(read_plan(folder / "plan.yaml"))


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        (REAL.replace(WORKSPACE, ""), "`workspace`"),
        (REAL.replace(KEEP_OUT, ""), "`keep_out: \\[\\]`"),
        (REAL.replace(WORKSPACE, "").replace(KEEP_OUT, ""), "no_workspace_because.*keep_out"),
        (REAL.replace(WORKSPACE, WHY).replace(KEEP_OUT, ""), "`keep_out"),
    ],
)
def test_a_cell_that_leaves_a_box_out_is_refused(tmp_path: Path, cell: str, words: str) -> None:
    with pytest.raises(SafetyError, match=words):
        opened(tmp_path, cell)


@pytest.mark.parametrize(
    "cell",
    [
        REAL,
        REAL.replace(KEEP_OUT, "keep_out: []\n"),
        REAL.replace(WORKSPACE, WHY),
        REAL.replace(WORKSPACE, WHY).replace(KEEP_OUT, "keep_out: []\n"),
    ],
)
def test_a_cell_that_says_so_is_taken(tmp_path: Path, cell: str) -> None:
    opened(tmp_path, cell)


def test_a_reason_must_be_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no_workspace_because"):
        opened(tmp_path, REAL.replace(WORKSPACE, "no_workspace_because: ok\n"))


def test_that_there_is_nothing_is_kept_when_a_cell_is_written_anew(tmp_path: Path) -> None:
    path = tmp_path / "cell.yaml"
    path.write_text(REAL.replace(KEEP_OUT, "keep_out: []\n"))
    written = yaml_text(read_cell(path).as_mapping())
    assert yaml.safe_load(written)["keep_out"] == []
    path.write_text(REAL.replace(KEEP_OUT, ""))
    assert "keep_out" not in read_cell(path).as_mapping()
