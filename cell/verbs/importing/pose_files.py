"""Poses as other tools write them: read as plain numbers, before anybody says what they mean."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing import RotationName, Unit
from cell.verbs.importing.names import named_pose

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
    rotations, unit:
        What names in the file say of them; empty and None where they do not.
    """

    where: str
    number: int | None
    values: FloatArray
    rotations: tuple[RotationName, ...] = ()
    unit: Unit | None = None


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
            found = [replace(found[0], number=number_in(file.stem))]
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
        where, number = f"{path}: {key or 'top level'}", _number_of(data, number)
        named, together = named_pose(data), _split_pose(data)
        if named is not None:
            yield RawPose(where, number, named.values, named.rotations, named.unit)
            return
        if together is not None:
            yield RawPose(where, number, together)
            return
        for name, item in data.items():
            told = number_in(str(name))
            inner = number if told is None else told
            yield from _nested(path, item, f"{key}.{name}".strip("."), inner)
    elif isinstance(data, list):
        for place, item in enumerate(data):
            yield from _nested(path, item, f"{key}[{place}]", None)


_NUMBERED = ("frame", "index", "id", "image", "file", "filename", "name", "image_path", "frame_id")


def _number_of(data: dict[str, Any], number: int | None) -> int | None:
    """Which image a mapping says it belongs to."""
    for key in _NUMBERED:
        value = data.get(key)
        if isinstance(value, int) and not isinstance(value, bool):
            return value
        if isinstance(value, str):
            return number_in(Path(value).stem)
    return number


def _split_pose(data: dict[str, Any]) -> FloatArray | None:
    """A mapping whose values are one position of 3 and one rotation of 3, 4 or 3x3 numbers."""
    lists = [_as_numbers(value) for value in data.values()]
    given = sorted((v for v in lists if v is not None and len(v) in (3, 4, 9)), key=len)
    if len(given) != 2 or len(given[0]) != 3:
        return None
    position, turn = given
    if len(turn) == 3:  # which is which tells their order in the file
        position, turn = (v for v in lists if v is not None and len(v) == 3)
    if len(turn) == 9:
        return np.hstack([turn.reshape(3, 3), position[:, None]]).ravel()
    return np.concatenate([position, turn])


def _as_numbers(data: Any) -> FloatArray | None:
    if not isinstance(data, list) or not data:
        return None
    try:
        return np.asarray(data, dtype=float).ravel()
    except (TypeError, ValueError):
        return None


def _rows(path: Path, text: str) -> Iterator[RawPose]:
    """CSV: columns by their names where a first row has them, else as `_line`."""
    dialect = ";" if text.count(";") > text.count(",") else "," if "," in text else "\t"
    rows = list(csv.reader(text.splitlines(), delimiter=dialect))
    head = rows[0] if rows else []
    if named_pose(dict.fromkeys(head, 0.0)) is not None:
        yield from _named_rows(path, head, rows[1:])
        return
    for line, row in enumerate(rows, 1):
        cells = [cell.strip() for cell in row if cell.strip()]
        numbers = [cell for cell in cells if _NUMBER.fullmatch(cell)]
        name = next((cell for cell in cells if cell not in numbers), None)
        yield from _row(f"{path}:{line}", numbers, name)


def _named_rows(path: Path, head: list[str], rows: list[list[str]]) -> Iterator[RawPose]:
    for line, row in enumerate(rows, 2):
        if not any(cell.strip() for cell in row):
            continue
        data: dict[str, Any] = {}
        for name, cell in zip(head, row, strict=False):
            words = cell.strip()
            data[name.strip()] = float(words) if _NUMBER.fullmatch(words) else words
        found = named_pose(data)
        if found is None:
            raise InputError(f"{path}:{line}: lacks numbers of the columns {', '.join(head)}")
        first = row[0].strip()
        number = _number_of({key.lower(): _whole(value) for key, value in data.items()}, None)
        if number is None and not _NUMBER.fullmatch(first):
            number = number_in(Path(first).stem)
        yield RawPose(f"{path}:{line}", number, found.values, found.rotations, found.unit)


def _whole(value: Any) -> Any:
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _lines(path: Path, text: str) -> Iterator[RawPose]:
    """Text: one pose a line, or matrices over four lines each."""
    plain = [words.partition("#")[0] for words in text.splitlines()]
    rows = [(line, _NUMBER.findall(words)) for line, words in enumerate(plain, 1)]
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
    elif len(numbers) - 1 in WIDTHS and name is None:  # a time stands first, as in TUM's files
        yield RawPose(where, None, np.array(numbers[1:], dtype=float))
    elif numbers:
        raise InputError(f"{where}: has {len(numbers)} numbers; a pose has 6, 7, 12 or 16")
