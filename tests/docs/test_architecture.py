"""The architecture page is made from the code: rooms, stops and floors in step, counts aside."""

from __future__ import annotations

import re

import pytest

from tests.docs.pages import ROOT
from tools.architecture_page import FLOORS, FOLDER, circles, files

_COUNT = re.compile(r"\d+")


@pytest.fixture(scope="module")
def made() -> dict[str, str]:
    return files()


@pytest.mark.parametrize("name", ["architecture.md", "pictures/chain.svg", "pictures/floors.svg"])
def test_page_and_pictures_are_in_step(name: str, made: dict[str, str]) -> None:
    stored = (FOLDER / name).read_text(encoding="utf-8")
    assert _COUNT.sub("#", stored) == _COUNT.sub("#", made[name]), "tools/architecture_page.py"


def test_no_arrow_between_floors_runs_up(made: dict[str, str]) -> None:
    rows = re.findall(r"^\| `cell/(\w+)` \| \d+ \| .* \| (.*) \|$", made["architecture.md"], re.M)
    assert [floor for floor, _ in rows] == list(FLOORS)
    for at, (_, below) in enumerate(rows):
        assert set(re.findall(r"[a-z]+", below)) <= set(FLOORS[at + 1 :])


def test_no_module_imports_itself_round_a_circle() -> None:
    assert circles() == []


def test_contributing_names_files_that_are_there() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:calib|cell|drivers|sim|tests|tools)/[\w./]+)`", text)
    assert len(named) > 20
    assert [path for path in named if "NAME" not in path and not (ROOT / path).exists()] == []


def test_every_top_package_says_what_it_may_import() -> None:
    for package in ("calib", "cell", "drivers", "sim", *(f"cell/{floor}" for floor in FLOORS)):
        text = (ROOT / package / "__init__.py").read_text(encoding="utf-8")
        assert "import" in text.split('"""')[1].lower(), package


def test_decision_13_says_where_things_are() -> None:
    text = (ROOT / "docs/decisions/0013-six-floors.md").read_text(encoding="utf-8")
    rows = [line.split("|")[3] for line in text.splitlines() if line.startswith("| ")][1:]
    places = [path for row in rows for path in re.findall(r"`(cell/[\w./]+)`", row)]
    assert len(places) == 3
    assert [path for path in places if not (ROOT / path).exists()] == []
