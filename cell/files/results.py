"""Where results go, and how they are written: each file whole, older ones of its name replaced."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from cell.errors import InputError


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
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            partial = folder / f"{name}.part"
            partial.write_text(content, encoding="utf-8")
            partial.replace(folder / name)
    except OSError as fault:
        raise InputError(
            f"{folder}: cannot be written: {fault.strerror}; give another -o"
        ) from None
