"""docs/tutorial.md: its commands run as they stand, its settings fit the files, its links lead."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from cell.storage.files.cell_file import AbbRobot, CellFile, UniversalRobot
from cell.storage.files.plan_file import read_plan
from cell.storage.recording import Corners, read_recording
from tests.cell.test_peers import SMALL
from tests.docs.pages import ROOT, blocks, commands, run_command

PAGES = [
    ROOT / "docs" / name
    for name in ("tutorial.md", "tutorial-ur.md", "tutorial-abb.md", "export.md")
]
TUTORIAL = PAGES[0]


@pytest.mark.slow
def test_from_a_dry_run_to_a_report_and_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    output = {
        " ".join(words[:3]): run_command(words)
        for block in blocks(TUTORIAL)
        if block.language == "console"
        for words in commands(block)
    }
    assert {name.split()[0] for name in output} >= {"doctor", "plan", "export"}
    assert (tmp_path / "runs/first/report.html").stat().st_size > 100_000
    assert "verdict: explained" in output["run my-plan.yaml --dry-run"]
    assert "focus_breathing" in output["run my-plan.yaml --dry-run"]
    assert (
        output["compare runs/first runs/second"].count("they agree within their uncertainty") == 2
    )
    camera = json.loads((tmp_path / "camera.json").read_text())
    assert camera["focus"]["law"] == "inverse_square"
    diagnosis = json.loads((tmp_path / "runs/broken/diagnosis/diagnosis.json").read_text())
    assert {e["name"] for e in diagnosis["effects"]} == {"joint_zero_offset"}


@pytest.mark.slow
@pytest.mark.parametrize("arm", ["ur", "abb"])
def test_the_rehearsals_run_through_the_real_drivers(
    arm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / f"tutorial-{arm}.md"
    shown = [block for block in blocks(page) if block.language == "console"]
    reported = [words for block in shown for words in commands(block)]
    assert [words[0] for words in reported if "--peers" in words] == ["run"]
    for words in reported:
        if "--peers" in words:
            _shrink(tmp_path / "configs/irb140-eosens.cell.yaml")
        run_command(words)
    wires = read_recording(tmp_path / f"runs/{arm}-wires")
    assert len(wires.frames) == len(read_plan(tmp_path / f"{arm}.plan.yaml").file.views)
    rehearsal = tmp_path / f"runs/{arm}-rehearsal"
    if rehearsal.exists():
        poses = [read_recording(folder).views(Corners({})) for folder in (rehearsal, wires.path)]
        off = poses[0].base_from_flange - poses[1].base_from_flange
        assert np.abs(off).max() < 1e-3


def _shrink(cell: Path) -> None:
    """A camera of a sixteenth of the pixels sees the same with less work."""
    text = cell.read_text()
    for of, instead in SMALL.items():
        text = text.replace(of, instead)
    cell.write_text(text)


@pytest.mark.parametrize(("arm", "robot"), [("ur", UniversalRobot), ("abb", AbbRobot)])
def test_its_settings_fit_the_cell_file(
    arm: str, robot: type[UniversalRobot] | type[AbbRobot]
) -> None:
    (text,) = [b.code for b in blocks(ROOT / f"docs/tutorial-{arm}.md") if b.language == "yaml"]
    given = YAML(typ="safe").load(text)
    assert robot.model_validate(given["robot"]).driver == arm
    example = "ur3-robotiq" if arm == "ur" else "irb140-eosens"
    whole = YAML(typ="safe").load((ROOT / f"configs/{example}.cell.yaml").read_text())
    CellFile.model_validate({**whole, **given})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]*)(?:#[^)]*)?\)", text):
        assert (page.parent / target).exists(), target
    for target, anchor in re.findall(r"\]\(([^)#]*)#([^)]+)\)", text):
        assert anchor in _anchors(page.parent / target), f"{target}#{anchor}"


def _anchors(page: Path) -> set[str]:
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
