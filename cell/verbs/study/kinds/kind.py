"""What a kind of study is made of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import pyarrow as pa
from rich.table import Table

from cell.storage.files.study_file import Study

Row = dict[str, Any]

HEAD = (
    pa.field("number", pa.int32(), nullable=False),
    pa.field("key", pa.string(), nullable=False),
    pa.field("status", pa.string(), nullable=False),
    pa.field("reason", pa.string()),
    pa.field("cpu_s", pa.float64()),
    pa.field("worker", pa.string()),
)
"""Columns of every row: which task, `done` or `failed` and why, and what it cost where."""


@dataclass(frozen=True)
class Task:
    """One row to be: its number in the study, and a key that no other task has."""

    number: int
    key: str

    def asked(self) -> Row:
        """The kind's own columns that are known before anything is done."""
        raise NotImplementedError


@dataclass(frozen=True)
class Kind:
    """A kind of study.

    Attributes
    ----------
    columns:
        Of its rows, behind `HEAD`; null where a task failed.
    tasks:
        All that the study asks for, in order; raises `InputError`.
    work:
        Does one task, on any machine, and returns the kind's own columns.
    summary:
        What all rows together say, for programs.
    tables:
        The same for people.
    """

    columns: tuple[pa.Field, ...]
    tasks: Callable[[Study], Sequence[Task]]
    work: Callable[[Study, Any], Row]
    summary: Callable[[Sequence[Row]], Mapping[str, Any]]
    tables: Callable[[Mapping[str, Any]], Sequence[Table]]

    @property
    def schema(self) -> pa.Schema:
        """Of its Parquet files."""
        return pa.schema([*HEAD, *self.columns])


def grouped(rows: Iterable[Row], column: str) -> list[tuple[Any, list[Row]]]:
    """Rows by a column's values, in the order in which these come first."""
    rows = list(rows)
    first = {row[column]: at for at, row in reversed(list(enumerate(rows)))}
    ordered = sorted(rows, key=lambda row: first[row[column]])
    return [(name, list(own)) for name, own in groupby(ordered, key=lambda row: row[column])]
