"""The tables of stops, disturbances and faults: so many trials of a kind, on every stand."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol, TypeVar

from benchmarks.fault_runs.stands import STANDS, Stand


class Named(Protocol):
    """A kind of trial, with its name in the table."""

    @property
    def name(self) -> str: ...


class Ran(Protocol):
    """What came of one run, with what it printed."""

    output: str


K = TypeVar("K", bound=Named)
T = TypeVar("T", bound=Ran)
Judged = list[tuple[T, list[str]]]
"""Trials, each with what was not as it must be."""


def print_table(
    description: str,
    columns: Sequence[str],
    kinds_of: Callable[[str], Sequence[K]],
    stand_of: Callable[[str, Path], AbstractContextManager[Stand]],
    judged: Callable[[Stand, Path, str, K, int, int], Judged[T]],
    row: Callable[[str, K, Judged[T]], list[str]],
) -> None:
    """Print the table; ends with exit status 1 unless everything was as it must be.

    Parameters
    ----------
    description:
        Of the command; its options are the same for all tables.
    kinds_of:
        What is tried on a stand, by its name.
    stand_of:
        Sets a stand up by its name, in a folder.
    judged:
        Makes so many trials of a kind with a seed: fewer where the machine is too busy, which is
        not as it must be either.
    row:
        Their cells, one a column.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--stand", choices=STANDS)
    parser.add_argument("--only", default="")
    parser.add_argument("--instants", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    bad = 0
    print(f"{_line(columns)}\n|{'---|' * len(columns)}")
    for name in STANDS:
        if asked.stand not in (None, name):
            continue
        with tempfile.TemporaryDirectory() as folder, stand_of(name, Path(folder)) as stand:
            for kind in (kind for kind in kinds_of(name) if asked.only in kind.name):
                found = judged(stand, Path(folder), name, kind, asked.instants, asked.seed)
                print(_line(row(name, kind, found)), flush=True)
                for trial, complaints in found:
                    for complaint in complaints:
                        bad += 1
                        print(f"{name}: {kind.name}: {complaint}\n{trial.output}", file=sys.stderr)
                bad += asked.instants - len(found)
    sys.exit(bool(bad))


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def worst(values: list[float | None]) -> str:
    """The longest of the times, and how many there were none of."""
    reported = [value for value in values if value is not None]
    missing = len(values) - len(reported)
    longest = f"{max(reported):.3f} s" if reported else "-"
    return f"{longest}, {missing} never" if reported and missing else longest
