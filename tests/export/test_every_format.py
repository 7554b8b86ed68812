"""A format of `cell export` is described in the documentation, and some test here reads it back."""

from __future__ import annotations

from pathlib import Path

import pytest

from cell.verbs.export import FORMATS

HERE = Path(__file__).parent
PAGE = (HERE.parents[1] / "docs/export.md").read_text(encoding="utf-8")
OTHERS = [path for path in HERE.glob("test_*.py") if path != Path(__file__)]
TESTS = "".join(path.read_text(encoding="utf-8") for path in OTHERS)


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_is_described_and_read_back(name: str) -> None:
    assert f"`{name}`" in PAGE
    assert f'"{name}"' in TESTS or f"'{name}'" in TESTS
