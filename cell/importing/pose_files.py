"""Poses as other tools write them: read as plain numbers, before anybody says what they mean."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from calib.views import FloatArray
from cell.errors import InputError

WIDTHS = (6, 7, 12, 16)
"""Numbers in a pose: position and three angles, position and quaternion, 3x4 or 4x4 matrix."""

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class RawPose:
    """One pose's numbers.

    Attributes
    ----------
    where:
        File and line or key, for messages.
    number:
        Which image it belongs to, where the file tells; its place in the file otherwise is None.
    values:
        6, 7, 12 or 16 numbers.
    """

    where: str
    number: int | None
    values: FloatArray


def read_poses(path: Path) -> list[RawPose]:
    """Read a pose file (.csv, .json, .yaml, .txt), or a folder of them with one pose each.

    Raises
    ------
    InputError
        It cannot be read, holds no pose, or holds poses of different widths.
    """
    files = sorted(path.iterdir(), key=natural) if path.is_dir() else [path]
    poses: list[RawPose] = []
    for file in files:
        found = list(_read_file(file))
        if path.is_dir() and len(found) == 1:
            found = [RawPose(found[0].where, number_in(file.stem), found[0].values)]
        poses += found
    widths = sorted({len(pose.values) for pose in poses})
    if not poses:
        raise InputError(
            f"{path}: holds no pose. A pose is a row of 7 numbers (position, quaternion) or 6"
            " (position, rotation), or a 4x4 matrix."
        )
    if len(widths) > 1:
        raise InputError(f"{path}: holds poses of {' and '.join(map(str, widths))} numbers")
    return poses


def natural(path: Path) -> list[tuple[int, int | str]]:
    """Sort key that puts 2 before 10."""
    parts = re.split(r"(\d+)", path.name)
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts]


def number_in(text: str) -> int | None:
    """The last number in a name, such as 12 in `image_0012`."""
    found = re.findall(r"\d+", text)
    return int(found[-1]) if found else None


def _read_file(path: Path) -> Iterator[RawPose]:
    try:
        text = path.read_text(encoding="utf-8")
        if path.suffix in (".json", ".yaml", ".yml"):
            data = json.loads(text) if path.suffix == ".json" else YAML(typ="safe").load(text)
            yield from _nested(path, data)
        elif path.suffix == ".csv":
            yield from _rows(path, text)
        else:
            yield from _lines(path, text)
    except (OSError, UnicodeDecodeError, ValueError, YAMLError) as fault:
        raise InputError(f"{path}: cannot be read as poses: {fault}") from None


def _nested(path: Path, data: Any, key: str = "", number: int | None = None) -> Iterator[RawPose]:
    """Whatever looks like a pose anywhere in JSON or YAML."""
    values = _as_numbers(data)
    if values is not None and len(values) in WIDTHS:
        yield RawPose(f"{path}: {key or 'top level'}", number, values)
    elif isinstance(data, dict):
        together = _split_pose(data)
        if together is not None:
            yield RawPose(f"{path}: {key}", number, together)
            return
        for name, item in data.items():
            yield from _nested(path, item, f"{key}.{name}".strip("."), number_in(str(name)))
    elif isinstance(data, list):
        for place, item in enumerate(data):
            yield from _nested(path, item, f"{key}[{place}]", None)


def _split_pose(data: dict[str, Any]) -> FloatArray | None:
    """A mapping whose values are one position of 3 and one rotation of 3 or 4 numbers."""
    lists = [_as_numbers(value) for value in data.values()]
    given = [values for values in lists if values is not None and len(values) in (3, 4)]
    if len(given) == 2 and len(given[0]) == 3:
        return np.concatenate(given)
    return None


def _as_numbers(data: Any) -> FloatArray | None:
    if not isinstance(data, list) or not data:
        return None
    try:
        return np.asarray(data, dtype=float).ravel()
    except (TypeError, ValueError):
        return None


def _rows(path: Path, text: str) -> Iterator[RawPose]:
    """CSV: the last numbers of each row are the pose, what stands before names the image."""
    for line, row in enumerate(csv.reader(text.splitlines()), 1):
        cells = [cell.strip() for cell in row if cell.strip()]
        numbers = [cell for cell in cells if _NUMBER.fullmatch(cell)]
        name = next((cell for cell in cells if cell not in numbers), None)
        yield from _row(f"{path}:{line}", numbers, name)


def _lines(path: Path, text: str) -> Iterator[RawPose]:
    """Text: one pose a line, or matrices over four lines each."""
    rows = [(line, _NUMBER.findall(words)) for line, words in enumerate(text.splitlines(), 1)]
    rows = [(line, numbers) for line, numbers in rows if numbers]
    if rows and all(len(numbers) == 4 for _, numbers in rows) and len(rows) % 4 == 0:
        for first in range(0, len(rows), 4):
            matrix = [number for _, numbers in rows[first : first + 4] for number in numbers]
            yield from _row(f"{path}:{rows[first][0]}", matrix, None)
        return
    for line, numbers in rows:
        yield from _row(f"{path}:{line}", numbers, None)


def _row(where: str, numbers: list[str], name: str | None) -> Iterator[RawPose]:
    if len(numbers) in WIDTHS:
        yield RawPose(where, number_in(name) if name else None, np.array(numbers, dtype=float))
    elif len(numbers) - 1 in WIDTHS and name is None and numbers[0].isdecimal():
        yield RawPose(where, int(numbers[0]), np.array(numbers[1:], dtype=float))
    elif numbers:
        raise InputError(f"{where}: has {len(numbers)} numbers; a pose has 6, 7, 12 or 16")
