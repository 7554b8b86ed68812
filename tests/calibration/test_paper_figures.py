"""docs/benchmark-paper.md: what stands there is what the scripts print."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks.paper_figures import FIGURES, PICTURES, table
from benchmarks.paper_runs import AS_IN_THE_PAPER, PLANS
from benchmarks.paper_tables import print_run
from tests.docs.pages import ROOT, assert_same

PAGE = ROOT / "docs" / "benchmark-paper.md"


def section(heading: str) -> str:
    """The page's text below a heading, up to the next one."""
    text = PAGE.read_text(encoding="utf-8")
    (found,) = re.findall(rf"^### {re.escape(heading)}\b(.*?)(?=^##|\Z)", text, re.S | re.M)
    return str(found)


def rows(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if line.startswith("|"))


@pytest.mark.parametrize("name", FIGURES)
def test_numbers_beside_a_figure_are_its_own(name: str) -> None:
    drawing, shown = FIGURES[name], section(name)
    assert f"(pictures/{drawing.file})" in shown
    printed = [table(heading, numbers()) for heading, numbers in drawing.numbers.items()]
    assert_same("\n".join(printed), rows(shown))


@pytest.mark.parametrize("cell", PLANS)
def test_tables_1_and_2_are_those_printed(cell: str, capsys: pytest.CaptureFixture[str]) -> None:
    _, plans = PLANS[cell]
    print_run(cell, next(plan for plan in plans if plan.name == AS_IN_THE_PAPER))
    assert_same(rows(capsys.readouterr().out), rows(section(f"{cell}, {AS_IN_THE_PAPER}")))


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_can_be_drawn_and_its_file_is_small(name: str, tmp_path: Path) -> None:
    drawing = FIGURES[name]
    drawing.draw().savefig(tmp_path / drawing.file)
    kept = (PICTURES / drawing.file).stat().st_size
    assert 5_000 < kept < 80_000
    assert (tmp_path / drawing.file).stat().st_size > 5_000
