"""Tables: CSV with or without names, columns by spaces, decimal commas, quoted cells."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing.layouts.nested import series_in
from cell.verbs.importing.raw import WIDTHS, RawPose, Series
from cell.verbs.importing.rotations import is_rotation, is_unit
from cell.verbs.importing.times import seconds

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_COMMA = re.compile(r"[-+]?\d+,\d+")
_SEVERAL = re.compile(r"[-+\d.,eE;\s\[\]()]+")
_EPOCH_S = 1e8


def read(path: Path, text: str) -> list[Series]:
    """Any text whose lines are rows of numbers; empty where none is.

    Raises
    ------
    InputError
        Rows of which no pose can be made; the message names the line.
    """
    rows = _rows(text)
    matrices = _matrices_over_lines(path, rows)
    if matrices:
        return [Series("4x4 matrices over four lines each", "", "flange", tuple(matrices))]
    head = _head(rows)
    if head is not None:
        found = _by_names(path, head, rows[1:])
        if found:
            return found
        rows = rows[1:]
    return _plain_rows(path, rows)


def _rows(text: str) -> list[tuple[int, list[str]]]:
    """Line number and cells of every row that has any."""
    lines = [(n, line.partition("#")[0]) for n, line in enumerate(text.splitlines(), 1)]
    lines = [(n, line) for n, line in lines if line.strip()]
    body = "\n".join(line for _, line in lines)
    separator, comma = _separator(body)
    out = []
    for number, line in lines:
        if separator == " ":
            cells = line.split()
        else:
            cells = [c.strip() for c in next(csv.reader(io.StringIO(line), delimiter=separator,
                                                        skipinitialspace=True))]  # fmt: skip
        if comma:
            cells = [c.replace(",", ".") if _COMMA.fullmatch(c) else c for c in cells]
        if any(cells):
            out.append((number, cells))
    return out


def _separator(body: str) -> tuple[str, bool]:
    """The character between cells, and whether numbers have a decimal comma."""
    unquoted = re.sub(r'"[^"]*"', "", body)
    for separator in (";", "\t"):
        if separator in unquoted:
            cells = [cell.strip() for cell in re.split(f"[{separator}\n]", unquoted)]
            return separator, any(_COMMA.fullmatch(cell) for cell in cells)
    parts = unquoted.split()
    if sum(bool(_COMMA.fullmatch(word)) for word in parts) > len(parts) / 2:
        return " ", True
    return ("," if "," in unquoted else " "), False


def _head(rows: Sequence[tuple[int, list[str]]]) -> list[str] | None:
    """The names in the first row, where it holds no number."""
    if not rows or any(_NUMBER.fullmatch(cell) for cell in rows[0][1]):
        return None
    return rows[0][1] if len(rows) > 1 and len(rows[0][1]) > 1 else None


def _by_names(
    path: Path, head: Sequence[str], rows: Sequence[tuple[int, list[str]]]
) -> list[Series]:
    """Series by the columns' names; empty where the names say no pose."""
    data: list[dict[str, Any]] = []
    for line, cells in rows:
        if len(cells) < len(head) or not all(cells[: len(head)]):
            lacking = [n for n, c in zip(head, [*cells, *[""] * len(head)], strict=False) if not c]
            if series_in(path, data[:1], "table with names"):
                raise InputError(
                    f"{path}:{line}: lacks numbers of the columns {', '.join(lacking)}"
                )
        data.append({name: _value(cell) for name, cell in zip(head, cells, strict=False)})
    first = [cell for _, (cell, *_) in rows]
    if not any(_NUMBER.fullmatch(cell) for cell in first):
        data = [{"image": cell, **row} for cell, row in zip(first, data, strict=True)]
    found = series_in(path, data, "table with names")
    return [s for s in found if len(s.poses) == len(rows)]


def _value(cell: str) -> Any:
    if _NUMBER.fullmatch(cell):
        return float(cell) if re.search(r"[.eE]", cell) else int(cell)
    numbers = _several(cell)
    return cell if numbers is None else numbers


def _several(cell: str) -> list[float] | None:
    """Numbers of a quoted cell that holds a list of them."""
    if not _SEVERAL.fullmatch(cell):
        return None
    numbers = [float(number) for number in _NUMBER.findall(cell)]
    return numbers if len(numbers) > 1 else None


def _plain_rows(path: Path, rows: Sequence[tuple[int, list[str]]]) -> list[Series]:
    parsed = [(line, *_split(cells)) for line, cells in rows]
    parsed = [(line, name, numbers) for line, name, numbers in parsed if len(numbers)]
    if not parsed:
        return []
    widths = {len(numbers) for _, _, numbers in parsed}
    if len(widths) > 1:
        return _uneven(path, parsed, widths)
    table = np.array([numbers for _, _, numbers in parsed])
    leading = _leading(table)
    if leading is None:
        raise InputError(
            f"{path}:{parsed[0][0]}: has {table.shape[1]} numbers; a pose has 6, 7, 12 or 16,"
            " perhaps after a number or a time. Name the columns (x, y, z, qx, qy, qz, qw, ...) in"
            " a first row, or leave out the others"
        )
    index, time, notes = _keys(table[:, :leading], table.shape[1] - leading)
    poses = [
        RawPose(
            f"{path}:{line}",
            None if index is None else int(index[k]),
            _position_first(numbers[leading:]),
            name=name,
            time_s=None if time is None else seconds(float(time[k])),
        )
        for k, (line, name, numbers) in enumerate(parsed)
    ]
    layout = "rows of numbers" if not leading else "rows of numbers after an index or a time"
    return [Series(layout, "", "flange", tuple(poses), notes)]


def _uneven(
    path: Path, parsed: Sequence[tuple[int, str | None, FloatArray]], widths: set[int]
) -> list[Series]:
    """Rows of unlike widths: all poses, of which the caller says what is wrong, or none."""
    for line, _, numbers in parsed:
        if len(numbers) not in WIDTHS:
            raise InputError(
                f"{path}:{line}: has {len(numbers)} numbers, and other rows"
                f" {' or '.join(str(w) for w in sorted(widths - {len(numbers)}))}"
            )
    poses = [RawPose(f"{path}:{line}", None, numbers, name=n) for line, n, numbers in parsed]
    return [Series("rows of numbers", "", "flange", tuple(poses))]


def _split(cells: Sequence[str]) -> tuple[str | None, FloatArray]:
    """The name of a row, where one stands in it, and its numbers."""
    name: str | None = None
    numbers: list[float] = []
    for cell in cells:
        value = _value(cell)
        if isinstance(value, int | float):
            numbers.append(float(value))
        elif isinstance(value, list):
            numbers += value
        elif name is None and re.search(r"\d", cell):
            name = Path(cell.replace("\\", "/")).name
    return name, np.array(numbers)


def _leading(table: FloatArray) -> int | None:
    """How many columns stand before the pose: as few as leave numbers that can be one."""
    width = table.shape[1]
    for count in (16, 12, 7, 6):
        leading = int(width - count)
        if 0 <= leading <= 3 and _can_be(table[:, leading:]):
            return leading
    return 0 if width in WIDTHS else None


def _can_be(numbers: FloatArray) -> bool:
    """Whether rows of 6, 7, 12 or 16 numbers can be poses."""
    width = numbers.shape[1]
    if width == 6:
        return True
    if width == 7:
        return all(is_unit(row[3:]) for row in numbers) or all(is_unit(row[:4]) for row in numbers)
    square = numbers.reshape(len(numbers), -1, 4)
    if width == 12:
        by_columns = numbers.reshape(-1, 4, 3).swapaxes(1, 2)
        return any(all(is_rotation(m[:3, :3]) for m in each) for each in (square, by_columns))
    return any(
        all(is_rotation(m[:3, :3]) for m in each) for each in (square, square.swapaxes(1, 2))
    )


def _position_first(values: FloatArray) -> FloatArray:
    """Seven numbers with the quaternion behind the position, as all others write it."""
    if len(values) == 7 and not is_unit(values[3:]) and is_unit(values[:4]):
        return np.concatenate([values[4:], values[:4]])
    return values


def _keys(
    columns: FloatArray, width: int
) -> tuple[FloatArray | None, FloatArray | None, tuple[str, ...]]:
    """An index and a time among the columns before the pose, and what to say of them."""
    index = time = None
    for column in columns.T:
        whole = bool((column == np.round(column)).all())
        if whole and np.abs(column).max() < _EPOCH_S:
            index = column if index is None and len(set(column)) == len(column) else index
        elif time is None:
            time = column
    what = [n for n, c in (("an index", index), ("a time", time)) if c is not None]
    if not columns.size:
        return None, None, ()
    layout = " and ".join(what) or "numbers that are no pose's"
    return index, time, (f"rows are {layout}, then a pose of {width} numbers",)


def _matrices_over_lines(path: Path, rows: Sequence[tuple[int, list[str]]]) -> list[RawPose]:
    numbers = [(line, _split(cells)[1]) for line, cells in rows]
    numbers = [(line, row) for line, row in numbers if len(row)]
    four = len(numbers) % 4 == 0 and all(len(row) == 4 for _, row in numbers)
    if not numbers or not four:
        return []
    return [
        RawPose(f"{path}:{numbers[k][0]}", None, np.concatenate([r for _, r in numbers[k : k + 4]]))
        for k in range(0, len(numbers), 4)
    ]
