"""Where results go, and how they are written: each file whole, older ones of its name replaced."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from pathlib import Path

from cell.errors import InputError
from cell.storage.atomic import write_atomically
from cell.storage.incoming.paths import reason


def results_folder(recording: Path, name: str, kind: str) -> Path:
    """Where results go without `-o`: into the recording, or here where that is read-only.

    Parameters
    ----------
    recording, name:
        The recording's folder, and what it is called.
    kind:
        What the results are: the name of their folder.
    """
    if os.access(recording, os.W_OK):
        return recording / kind
    return Path.cwd() / f"{name}-{kind}"


def write_results(folder: Path, files: Mapping[str, str]) -> None:
    """Write texts by their file names; raises `InputError` where the folder cannot be written."""
    make_folder(folder)
    for name, content in files.items():
        write_atomically(folder / name, content)


def make_folder(folder: Path) -> None:
    """Make a folder that may be there already; raises `InputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as fault:
        raise InputError(f"{folder}: cannot be written: {reason(fault)}; give another -o") from None


def new_folder(name: str) -> Path:
    """A folder under `runs/` for results whose place was not given."""
    same = same_folder(name)
    return same.with_name(f"{same.name}-{time.strftime('%Y%m%d-%H%M%S')}")


def same_folder(name: str) -> Path:
    """The folder under `runs/` of what goes on where it was left."""
    return Path("runs") / "".join(c if c.isalnum() or c in "-_" else "-" for c in name).strip("-")
