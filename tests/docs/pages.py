"""Pages of the documentation, run: what their blocks print is compared with what they show."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from cell.cli.app import app

ROOT = Path(__file__).parents[2]
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    language: str
    code: str
    line: int


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(found[1], found[2], text.count("\n", 0, found.start()) + 1)
        for found in _BLOCK.finditer(text)
    ]


def run_python(code: str, line: int, page: Path, names: dict[str, Any]) -> str:
    """What a block prints; errors say the page's own lines."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile("\n" * line + code, str(page), "exec"), names)
    return printed.getvalue()


def commands(block: Block) -> Iterator[list[str]]:
    """The words of every `$ cell ...` line."""
    joined = block.code.replace("\\\n", " ")
    for line in joined.splitlines():
        if line.startswith("$ cell "):
            yield shlex.split(line.removeprefix("$ cell "), comments=True)


def run_command(words: list[str]) -> str:
    """What the command prints on stdout and stderr; it must succeed."""
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, f"cell {' '.join(words)}\n{done.output}\n{done.exception}"
    return str(done.output)


def assert_same(printed: str, shown: str, *, relative: float = 0.1) -> None:
    """Words must be equal, numbers nearly: they depend a little on the machine."""
    assert _NUMBER.sub("#", printed).split() == _NUMBER.sub("#", shown).split(), printed
    for value, reported in zip(_NUMBER.findall(printed), _NUMBER.findall(shown), strict=True):
        assert float(value) == pytest.approx(float(reported), rel=relative, abs=0.011), printed
