"""The pages for an engineer with somebody else's pictures, and for who keeps a cell good: run."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import pytest

from cell.storage.files.plan_file import read_plan
from cell.storage.files.writing import yaml_text
from cell.storage.recording import read_recording
from tests.docs.pages import ROOT, blocks, commands, run_command

VIEWS = slice(8, 21)  # neighbours on the way: two fronto-parallel, the others tilted
ALPHA_PX = 1370.0


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_page(name: str) -> dict[str, str]:
    """What each command of the page's console blocks prints, by its verb (the last one's)."""
    return {
        words[0]: run_command(words)
        for block in blocks(ROOT / "docs" / name)
        if block.language == "console"
        for words in commands(block)
    }


def somebody_elses_pictures(here: Path) -> None:
    """`photos/` and `poses.csv`, in millimetres, as another tool would leave them."""
    plan = read_plan(here / "configs/ur3-robotiq.plan.yaml")
    few = plan.file.model_copy(update={"views": plan.file.views[VIEWS], "cell": plan.cell})
    (here / "few.plan.yaml").write_text(yaml_text(few.as_mapping()))
    run_command(["run", "few.plan.yaml", "--dry-run", "--record-only", "-o", "theirs"])
    recording = read_recording(here / "theirs")
    (here / "photos").mkdir()
    rows = ["x_mm,y_mm,z_mm,qx,qy,qz,qw"]
    for number, frame in enumerate(recording.frames):
        assert frame.image is not None
        assert frame.base_from_flange is not None
        shutil.copy(here / "theirs" / frame.image, here / "photos" / f"shot_{number:02d}.png")
        pose = frame.base_from_flange
        millimetres = [1e3 * value for value in pose.p_m]
        rows.append(",".join(f"{value:.7f}" for value in (*millimetres, *pose.q_xyzw)))
    (here / "poses.csv").write_text("\n".join(rows) + "\n")


def test_somebody_else_s_pictures_become_a_camera(here: Path) -> None:
    somebody_elses_pictures(here)
    printed = run_page("howto/import.md")
    assert "positions are in mm" in printed["import"]
    assert "the pictures bear this out" in printed["import"]
    assert "answer: Use this camera from" in printed["calibrate"]
    assert "static_transform_publisher" in printed["export"]
    storage = cv2.FileStorage(str(here / "camera.yaml"), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    assert matrix[0, 0] == pytest.approx(ALPHA_PX, rel=0.01)


def test_an_untouched_camera_is_still_good(here: Path) -> None:
    assert "still good" in run_page("verify.md")["verify"]
    found = json.loads((here / "runs/today/verify/verify.json").read_text())
    assert found["verdict"] == "good"
