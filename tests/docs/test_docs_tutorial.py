"""docs/tutorial.md: its commands run as they stand, its settings fit the files, its links lead."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from cell.files.cell_file import AbbRobot, UniversalRobot
from tests.docs.pages import ROOT, blocks, commands, run_command

PAGES = [ROOT / "docs" / name for name in ("tutorial.md", "python-api.md", "export.md")]
TUTORIAL = PAGES[0]


@pytest.mark.slow
def test_from_a_dry_run_to_a_report_and_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    said = {
        " ".join(words[:3]): run_command(words)
        for block in blocks(TUTORIAL)
        if block.language == "console"
        for words in commands(block)
    }
    assert {name.split()[0] for name in said} >= {"doctor", "plan", "export"}
    assert (tmp_path / "runs/first/report.html").stat().st_size > 100_000
    assert "verdict: explained" in said["run my-plan.yaml --dry-run"]
    assert "focus_breathing" in said["run my-plan.yaml --dry-run"]
    assert said["compare runs/first runs/second"].count("they agree within their uncertainty") == 2
    camera = json.loads((tmp_path / "camera.json").read_text())
    assert camera["focus"]["law"] == "inverse_square"
    diagnosis = json.loads((tmp_path / "runs/broken/diagnosis/diagnosis.json").read_text())
    assert {e["name"] for e in diagnosis["effects"]} == {"joint_zero_offset"}


def test_its_settings_fit_the_cell_file() -> None:
    texts = [block.code for block in blocks(TUTORIAL) if block.language == "yaml"]
    ur, abb = (YAML(typ="safe").load(text)["robot"] for text in texts)
    assert UniversalRobot.model_validate(ur).address == "192.168.1.10"
    assert AbbRobot.model_validate(abb).address == "192.168.125.1"


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
