"""A study's folder: which study it holds, and the rows done so far.

::

    study.json              the study, its plan and its cell: what the rows depend on
    results/part-000000.parquet, ...    rows as they came; a part is written whole and never again
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cell.errors import InputError
from cell.files.study_file import Study
from cell.study.kinds import Row

MANIFEST, RESULTS, LOCK = "study.json", "results", ".lock"
SCHEMA = "cell.study-results/1"
_TOLD = 3


class StudyFolder:
    """Rows of a study on disk; made by `opened`."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self.path = path
        self._results = path / RESULTS
        self._schema = schema
        self._next = 0

    @classmethod
    @contextmanager
    def opened(cls, path: Path, study: Study, schema: pa.Schema) -> Iterator[StudyFolder]:
        """The folder, held against others; begun where it is new.

        Raises
        ------
        InputError
            It holds another study, or something else; somebody else is at it; it cannot be
            written.
        """
        try:
            (path / RESULTS).mkdir(parents=True, exist_ok=True)
            with (path / LOCK).open("w") as lock:
                _hold(lock.fileno(), path)
                _same_study(path, study)
                folder = cls(path, schema)
                folder._tidy()
                yield folder
        except OSError as error:
            raise InputError(
                f"{error.filename or path}: cannot be read or written ({error.strerror})"
            ) from None

    def rows(self) -> list[Row]:
        """Every row, in the order of tasks."""
        parts = [_read(part, self._schema) for part in self._parts()]
        rows: list[Row] = [row for part in parts for row in part.to_pylist()]
        return sorted(rows, key=lambda row: row["number"])

    def keys(self) -> set[str]:
        """Keys of the tasks that have their row."""
        parts = [_read(part, self._schema, ["key"]) for part in self._parts()]
        return {key for part in parts for key in part["key"].to_pylist()}

    def add(self, rows: Sequence[Row]) -> None:
        """Write rows as a new part; once this returns they are on the disk."""
        part = self._results / f"part-{self._next:06d}.parquet"
        partial = part.with_name(f".{part.name}")
        with partial.open("wb") as file:
            pq.write_table(pa.Table.from_pylist(rows, schema=self._schema), file)
            file.flush()
            os.fsync(file.fileno())
        # a hard link refuses where a file is, a rename would take its place
        os.link(partial, part)
        partial.unlink()
        _sync(self._results)
        self._next += 1

    def _parts(self) -> list[Path]:
        return sorted(self._results.glob("part-*.parquet"))

    def _tidy(self) -> None:
        """Drop a part that a crash left unfinished, and count on behind the last whole one."""
        for partial in self._results.glob(".part-*.parquet"):
            partial.unlink()
        parts = self._parts()
        self._next = int(parts[-1].stem.removeprefix("part-")) + 1 if parts else 0


def _hold(descriptor: int, path: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            f"{path}: another `cell study` is at work there; wait for it, or give another -o"
        ) from None


def _same_study(path: Path, study: Study) -> None:
    """Refuse a folder that holds another study; write the manifest where there is none."""
    manifest, now = path / MANIFEST, {"schema": SCHEMA, **study.as_mapping()}
    if not manifest.exists():
        if any((path / RESULTS).iterdir()):
            raise InputError(f"{path}: holds results but no {MANIFEST}; give another -o")
        partial = path / f".{MANIFEST}"
        with partial.open("w", encoding="utf-8") as file:
            json.dump(now, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(manifest)
        _sync(path)
        return
    try:
        before = json.loads(manifest.read_text(encoding="utf-8"))
    except ValueError as broken:
        raise InputError(f"{manifest}: is no JSON ({broken}); give another -o") from None
    changed = _changed(before, json.loads(json.dumps(now)))
    if changed:
        more = f" and {len(changed) - _TOLD} more" if len(changed) > _TOLD else ""
        raise InputError(
            f"{study.path}: is not the study that {path} was begun with; changed:"
            f" {', '.join(changed[:_TOLD])}{more}. Its results stand beside the new ones only in"
            " another folder: give another -o, or take the change back."
        )


def _changed(before: Any, now: Any, at: str = "") -> list[str]:
    """Dotted keys at which two plain values differ."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        keys = sorted(set(before) | set(now))
        return [
            place
            for key in keys
            for place in _changed(before.get(key), now.get(key), f"{at}.{key}".lstrip("."))
        ]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = enumerate(zip(before, now, strict=True))
        return [place for k, (a, b) in pairs for place in _changed(a, b, f"{at}.{k}")]
    return [] if before == now else [at]


def _read(part: Path, schema: pa.Schema, columns: list[str] | None = None) -> pa.Table:
    try:
        return pq.ParquetFile(part).read(columns=columns)
    except (OSError, pa.ArrowInvalid) as broken:
        raise InputError(f"{part}: is no whole Parquet file ({broken}); move it away") from None


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
