"""What verbs print: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

JsonFlag = Annotated[
    bool, typer.Option("--json", help="Print the result as one JSON object on stdout.")
]


def show(text: str, result: Mapping[str, Any], *, as_json: bool) -> None:
    """Print a verb's result, for people or for programs."""
    sys.stdout.write((json.dumps(result, default=str) if as_json else text) + "\n")


def say(text: str) -> None:
    """Tell the operator something that is not the result."""
    sys.stderr.write(text + "\n")


def say_error(text: str) -> None:
    """Tell an error; several, one a line, stand below each other with their file and line first."""
    say(f"error:\n{text}" if "\n" in text else f"error: {text}")


def new_folder(name: str) -> Path:
    """A folder under `runs/` for results whose place was not given."""
    same = same_folder(name)
    return same.with_name(f"{same.name}-{time.strftime('%Y%m%d-%H%M%S')}")


def same_folder(name: str) -> Path:
    """The folder under `runs/` of what goes on where it was left."""
    return Path("runs") / "".join(c if c.isalnum() or c in "-_" else "-" for c in name).strip("-")
