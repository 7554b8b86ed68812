"""One file a layout: each reads a text that is its own, and finds nothing in another's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cell.errors import InputError
from cell.verbs.importing.layouts import (
    assignments,
    delimited,
    documents,
    fanuc,
    krl,
    numpy_archive,
    opencv_storage,
    rapid,
    tf_echo,
    urscript,
)
from cell.verbs.importing.raw import Series

Reader = Callable[[Path, str], list[Series]]

PROGRAMS: tuple[Reader, ...] = (
    opencv_storage.read,
    tf_echo.read,
    rapid.read,
    krl.read,
    fanuc.read,
    urscript.read,
    assignments.read,
)
"""Told by their own words; the first that finds something has it."""

_ARCHIVES = (".npz", ".npy")


def read_file(path: Path) -> list[Series]:
    """All series of poses and joint angles in a file.

    Raises
    ------
    InputError
        The file cannot be read, or is broken; the message names file and line.
    """
    try:
        if path.suffix.lower() in _ARCHIVES:
            return numpy_archive.read(path)
        return _read_text(path, path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read as poses: {fault}") from None


def _read_text(path: Path, text: str) -> list[Series]:
    for read in PROGRAMS:
        found = read(path, text)
        if found:
            return found
    suffix = path.suffix.lower()
    if suffix in (".json", ".jsonl") or (text.lstrip()[:1] in ("{", "[") and suffix != ".csv"):
        return documents.read_json(path, text)
    if suffix in (".yaml", ".yml", ".samples"):
        return documents.read_yaml(path, text)
    return delimited.read(path, text) if suffix == ".csv" else _unknown(path, text)


def _unknown(path: Path, text: str) -> list[Series]:
    """Text of no known suffix: YAML where it looks like one, rows of numbers else."""
    first = next((line for line in text.splitlines() if line.strip("# \t")), "")
    if first.startswith(("---", "- ", "-\n")) or first.rstrip().endswith(":"):
        return documents.read_yaml(path, text)
    return delimited.read(path, text)
