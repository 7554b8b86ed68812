"""docs/study.md: its commands run, what they print is what it shows, its study files are read."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from cell.storage.files.study_file import StudyFile
from cell.storage.files.yaml_model import parse_model, read_mapping
from tests.docs.pages import ROOT, assert_same, blocks, commands, run_command, run_python

PAGE = ROOT / "docs" / "study.md"


def test_the_page_says_what_it_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    # one worker takes the least processor time, and the page is about what comes out
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0})
    monkeypatch.setenv("COLUMNS", "100")
    names: dict[str, object] = {}
    found = blocks(PAGE)
    output = ""
    for block in found:
        if block.language == "console":
            (words,) = commands(block)
            output = run_command(words)
        elif block.language == "python":
            output = run_python(block.code, block.line, PAGE, names)
        elif block.language == "text":
            assert_same(output, block.code, relative=0.2)
    assert (tmp_path / "runs/by-hand/results").is_dir()


def test_its_study_files_are_read(tmp_path: Path) -> None:
    kinds = []
    for block in blocks(PAGE):
        if block.language == "yaml":
            path = tmp_path / "some.study.yaml"
            path.write_text(block.code)
            kinds.append(parse_model(path, read_mapping(path), StudyFile).kind)
    assert kinds == ["monte_carlo", "power", "recordings"]
