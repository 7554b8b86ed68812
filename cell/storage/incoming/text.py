"""Bytes and text of a file, no more than it may have, and never from a pipe or a device."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

from cell.errors import InputError
from cell.storage.incoming.limits import DIGITS, JSON_BYTES, LINE_CHARACTERS, MIB, NESTING
from cell.storage.incoming.paths import check_plain, reason
from cell.storage.incoming.values import check_values

_LONG_NUMBER = re.compile(rf"\d{{{DIGITS + 1}}}")
_BRACKETS = re.compile(r"[\[\]{}]")
_MANY_MARKS = re.compile(rf"(?:[-?:]\s+){{{NESTING}}}|^\s{{{16 * NESTING}}}\s*\S")
"""Blocks in blocks: on one line, or by their indentation."""


def read_bytes(path: Path, most: int) -> bytes:
    """All of a file.

    Raises
    ------
    InputError
        It cannot be read, is no ordinary file, or has more than `most` bytes.
    """
    try:
        # a named pipe without a writer would block for ever
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    except (OSError, ValueError) as fault:
        raise InputError(f"{path}: cannot be read: {reason(fault)}. Check the path.") from None
    try:
        status = os.fstat(handle)
        check_plain(path, status.st_mode)
        with open(handle, "rb", closefd=False) as file:
            # no more than asked for is allocated
            data = file.read(status.st_size + 1) if status.st_size <= most else None
    except OSError as fault:
        raise InputError(f"{path}: cannot be read: {reason(fault)}") from None
    finally:
        os.close(handle)
    if data is None or len(data) > most:
        raise InputError(
            f"{path}: has {status.st_size / MIB:.0f} MiB; such a file has at most {most // MIB} MiB"
        )
    return data


def read_text(path: Path, most: int) -> str:
    """All of a file as text; a byte-order mark at its start is dropped.

    Raises
    ------
    InputError
        As `read_bytes`, and where it is not in UTF-8.
    """
    try:
        return read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as broken:
        raise InputError(f"{path}: is not a text file in UTF-8 (byte {broken.start})") from None


def check_text(text: str, path: Path) -> None:
    """Refuse text on which a reader made for people's files would take for ever.

    Raises
    ------
    InputError
        It has a line or a number without end, or is nested too deeply.
    """
    if _LONG_NUMBER.search(text):
        raise InputError(f"{path}: holds a number of more than {DIGITS} digits")
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > LINE_CHARACTERS:
            raise InputError(f"{path}:{number}: the line has {len(line)} characters")
        if _MANY_MARKS.search(line):
            raise InputError(f"{path}:{number}: is nested too deeply")
    depth = 0
    for bracket in _BRACKETS.finditer(text):
        depth = max(0, depth + (1 if bracket[0] in "[{" else -1))
        if depth > NESTING:
            at = text.count("\n", 0, bracket.start()) + 1
            raise InputError(f"{path}:{at}: is nested more than {NESTING} deep")


def parse_json(text: str | bytes, where: str, *, finite: bool = True) -> Any:
    """JSON whose values `check_values` accepts; raises `InputError`."""
    try:
        data = json.loads(text, parse_int=_whole)
    except RecursionError:
        raise InputError(f"{where}: is nested too deeply") from None
    except ValueError as broken:
        raise InputError(f"{where}: is no JSON: {broken}") from None
    check_values(data, where, finite=finite)
    return data


def read_json(path: Path, most: int = JSON_BYTES) -> Any:
    """The JSON of a file; raises `InputError`."""
    return parse_json(read_bytes(path, most), str(path))


def _whole(digits: str) -> int:
    if len(digits) > DIGITS:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)
