"""One file a layout: each reads a text that is its own, and finds nothing in another's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cell.errors import InputError
from cell.storage.incoming import check_text, read_text
from cell.storage.incoming.limits import POSES_BYTES
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
"""Recognised by their own keywords; the first that finds something has it."""

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
        text = read_text(path, POSES_BYTES)
        check_text(text, path)
        return _finite(_read_text(path, text))
    except (ValueError, ArithmeticError, RecursionError) as fault:
        reported = str(fault)[:200] or type(fault).__name__
        raise InputError(f"{path}: cannot be read as poses: {reported}") from None


def _finite(found: list[Series]) -> list[Series]:
    for pose in (pose for series in found for pose in series.poses):
        if not np.isfinite(pose.values).all():
            raise InputError(f"{pose.where}: holds a number that is not finite")
    return found


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
