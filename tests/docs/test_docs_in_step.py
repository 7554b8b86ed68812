"""README, links and the effects' pages: what they say is so."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.main import get_command

from calib.chain.kinematics import MODELS
from cell.cli.app import VERBS, app
from cell.errors import EXIT_SAFETY
from cell.storage.files.plan_file import read_plan
from cell.verbs.simulate import with_effects
from tests.docs.pages import ROOT, assert_same, blocks, commands, run_command
from tools import reference_pages
from tools.effect_pages import FOLDER, pages

README = ROOT / "README.md"
CELL_FILES = ROOT / "docs/plan-and-cell-files.md"
PAGES = sorted([README, ROOT / "CHANGELOG.md", *(ROOT / "docs").rglob("*.md")])
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_INDENTED = re.compile(r"^ {4}(cell .*)$", re.MULTILINE)


def _name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def test_the_readme_tour_says_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    tour = next(block for block in blocks(README) if block.language == "console")
    output = {words[0]: run_command(words) for words in commands(tour)}
    assert list(output) == ["doctor", "simulate", "calibrate", "diagnose", "export"]
    shown = README.read_text().split("names the bracket and nothing else:")[1]
    lines = [line.strip() for line in shown.splitlines() if line.startswith("    ")]
    reported = output["diagnose"].splitlines()
    assert_same("\n".join(reported[reported.index(lines[0]) :][:3]), "\n".join(lines))
    assert output["diagnose"].count("\n- ") == 1
    assert "distortion_model: plumb_bob" in output["export"]
    assert (tmp_path / "runs/bracket/diagnosis/report.html").exists()


def test_the_readme_names_every_verb_and_exit_status() -> None:
    text = README.read_text()
    assert re.findall(r"^\| `cell (\w+)", text, re.MULTILINE) == list(VERBS)
    statuses = re.findall(r"^\| (\d) \| ", text, re.MULTILINE)
    assert statuses == [str(k) for k in range(EXIT_SAFETY + 1)]


def test_the_readme_and_the_cell_files_page_name_every_arm() -> None:
    supported = README.read_text().split("## What is supported")[1].split("\n## ")[0]
    (row,) = re.findall(r"^\| `robot.model` \|.*$", CELL_FILES.read_text(), re.MULTILINE)
    for text in (supported, row):
        assert set(re.findall(r"\b(?:ur\d\w*|irb\d\w*)\b", text)) == set(MODELS)


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in _LINK.findall(page.read_text(encoding="utf-8")):
        if not target.startswith(("https://", "#")):
            assert (page.parent / target.split("#")[0]).exists(), target


def test_every_page_is_reached_from_the_readme() -> None:
    reached, ahead = set(), [README]
    while ahead:
        page = ahead.pop()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        targets = [t.split("#")[0] for t in _LINK.findall(page.read_text(encoding="utf-8"))]
        ahead += [(page.parent / t).resolve() for t in targets if t and not t.startswith("http")]
    assert not set(PAGES) - reached


def test_pages_of_the_effects_are_in_step() -> None:
    written = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.md")}
    assert written == pages(), "python tools/effect_pages.py"


def test_pages_of_the_reference_are_in_step() -> None:
    written = {
        path.name: path.read_text(encoding="utf-8") for path in reference_pages.FOLDER.glob("*.md")
    }
    assert written == reference_pages.pages(), "python tools/reference_pages.py"


def test_the_site_builds_and_no_link_or_anchor_leads_nowhere(tmp_path: Path) -> None:
    config = ROOT / "tools" / "mkdocs.yml"
    build = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "-q",
        "-f",
        config,
        "-d",
        tmp_path,
    ]
    built = subprocess.run(build, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    assert (tmp_path / "reference" / "verbs.html").exists()


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_commands_have_the_options_that_pages_give_them(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    known = {
        name: {o for p in verb.params for o in p.opts} | {"--help"}
        for name, verb in get_command(app).commands.items()  # type: ignore[attr-defined]
    }
    for line in [*_INDENTED.findall(text), *re.findall(r"`(cell [a-z]+ [^`]*)`", text)]:
        verb, *words = line.split("#")[0].split()[1:]
        assert verb in known, line
        used = {w.strip("[],.;)") for w in words if w.strip("[").startswith("-")}
        assert used <= known[verb], f"{line}: {used - known[verb]}"


def test_effects_on_the_pages_are_accepted() -> None:
    plan = read_plan(ROOT / "configs" / "irb140-eosens.plan.yaml")
    given = [
        effect
        for page in PAGES
        for effect in re.findall(r"--effect ([a-z_]+:\S+=\S+)", page.read_text(encoding="utf-8"))
    ]
    assert len(given) > len(pages())
    for effect in given:
        with_effects(plan, (effect.rstrip("`"),))
