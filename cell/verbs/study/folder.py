"""A study's folder: which study it holds, the rows done so far, and what failed on the way.

::

    study.json              the study, its plan and its cell: what the rows depend on
    results/part-000000.parquet, ...    rows of tasks that are done, one a task
    failures/part-000000.parquet, ...   a row for every time that a task failed, of the same columns

Rows come as parts; a part is written whole and never again. A failure stays where it is when its
task is done at last.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cell.errors import InputError
from cell.storage.atomic import sync_folder
from cell.storage.files.study_file import Study
from cell.storage.incoming.text import read_json
from cell.verbs.study.kinds import Row
from cell.verbs.study.work import FAILED

MANIFEST, RESULTS, FAILURES, LOCK = "study.json", "results", "failures", ".lock"
SCHEMA = "cell.study-results/2"
_SHOWN_AT_MOST = 3


class _Table:
    """Rows in a folder of parts."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self._path, self._schema = path, schema
        self._drop_unfinished()
        parts = self._parts()
        self._next = int(parts[-1].stem.removeprefix("part-")) + 1 if parts else 0

    def read(self, columns: list[str] | None = None) -> list[Row]:
        """Every row, in the order of tasks, and of writing where a task has several."""
        parts = [_read(part, columns) for part in self._parts()]
        rows: list[Row] = [row for part in parts for row in part.to_pylist()]
        return sorted(rows, key=lambda row: row["number"])

    def add(self, rows: Sequence[Row]) -> None:
        """Write rows as a new part; once this returns they are on the disk."""
        part = self._path / f"part-{self._next:06d}.parquet"
        partial = part.with_name(f".{part.name}")
        with partial.open("wb") as file:
            pq.write_table(pa.Table.from_pylist(rows, schema=self._schema), file)
            file.flush()
            os.fsync(file.fileno())
        # a hard link refuses where a file is, a rename would take its place
        os.link(partial, part)
        partial.unlink()
        sync_folder(self._path)
        self._next += 1

    def _parts(self) -> list[Path]:
        return sorted(self._path.glob("part-*.parquet"))

    def _drop_unfinished(self) -> None:
        """What a crash left half written."""
        for partial in self._path.glob(".part-*.parquet"):
            partial.unlink()


class StudyFolder:
    """Rows of a study on disk; made by `opened`."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self.path = path
        self._results = _Table(path / RESULTS, schema)
        self._failures = _Table(path / FAILURES, schema)

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
            for table in (RESULTS, FAILURES):
                (path / table).mkdir(parents=True, exist_ok=True)
            with (path / LOCK).open("w") as lock:
                _hold(lock.fileno(), path)
                _same_study(path, study)
                yield cls(path, schema)
        except OSError as error:
            raise InputError(
                f"{error.filename or path}: cannot be read or written ({error.strerror})"
            ) from None

    def done(self) -> list[Row]:
        """Rows of the tasks that are done, in the order of tasks."""
        return self._results.read()

    def done_keys(self) -> set[str]:
        """Their keys."""
        return {row["key"] for row in self._results.read(["number", "key"])}

    def failed(self) -> list[Row]:
        """The last failure of every task that is not done, with `tries`, how many it has."""
        rows, done = self._failures.read(), self.done_keys()
        tries = Counter(row["key"] for row in rows)
        last = {row["key"]: row for row in rows if row["key"] not in done}
        return [{**row, "tries": tries[key]} for key, row in last.items()]

    def add(self, rows: Sequence[Row]) -> None:
        """Write rows, done or failed; once this returns they are on the disk."""
        failed = [row for row in rows if row["status"] == FAILED]
        done = [row for row in rows if row["status"] != FAILED]
        for table, own in ((self._results, done), (self._failures, failed)):
            if own:
                table.add(own)


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
        if any((path / RESULTS).iterdir()) or any((path / FAILURES).iterdir()):
            raise InputError(f"{path}: holds results but no {MANIFEST}; give another -o")
        partial = path / f".{MANIFEST}"
        with partial.open("w", encoding="utf-8") as file:
            json.dump(now, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(manifest)
        sync_folder(path)
        return
    before = read_json(manifest)
    schema = before.get("schema") if isinstance(before, dict) else None
    if schema != SCHEMA:
        raise InputError(
            f"{path}: was written by another version of this program ({schema}, not {SCHEMA});"
            " give another -o"
        )
    changed = _changed(before, json.loads(json.dumps(now)))
    if changed:
        more = f" and {len(changed) - _SHOWN_AT_MOST} more" if len(changed) > _SHOWN_AT_MOST else ""
        raise InputError(
            f"{study.path}: is not the study that {path} was begun with; changed:"
            f" {', '.join(changed[:_SHOWN_AT_MOST])}{more}. Its results stand beside the new ones"
            " only in another folder: give another -o, or take the change back."
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


def _read(part: Path, columns: list[str] | None) -> pa.Table:
    try:
        return pq.ParquetFile(part).read(columns=columns)
    except (OSError, pa.ArrowInvalid) as broken:
        raise InputError(f"{part}: is no whole Parquet file ({broken}); move it away") from None
