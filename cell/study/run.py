"""A study from its file to its rows: what is missing is done, what is done stays."""

from __future__ import annotations

import hashlib
import json
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from distributed import Client, Future, KilledWorker
from rich.table import Table

from cell.errors import StoppedByOperator
from cell.files.study_file import Study
from cell.sequencer.stop import StopRequest
from cell.study.cluster import workers_of
from cell.study.folder import RESULTS, StudyFolder
from cell.study.kinds import Kind, Row, Task, kind_of
from cell.study.work import FAILED, given, lost, work
from drivers.errors import DeviceUnreachable

_HOLD_S = 1.0
"""A row waits at most so long for others to share its file."""
_LOOK_S = 0.1

Listener = Callable[[int, int], None]


@dataclass(frozen=True)
class Outcome:
    """A study that has all its rows, and what they say."""

    folder: Path
    kind: Kind
    rows: tuple[Row, ...]

    @property
    def results(self) -> Path:
        """Folder of the Parquet files."""
        return self.folder / RESULTS

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """What the rows say, by the kind of study; those of failed tasks left out."""
        return self.kind.summary([row for row in self.rows if row["status"] != FAILED])

    def tables(self) -> Sequence[Table]:
        """The summary for people."""
        return self.kind.tables(self.summary)

    @property
    def failed(self) -> list[Row]:
        """Rows of tasks that failed."""
        return [row for row in self.rows if row["status"] == FAILED]


def run_study(
    study: Study,
    folder: Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    stop: StopRequest | None = None,
    listener: Listener = lambda done, total: None,
) -> Outcome:
    """Do all tasks of a study that have no row yet, and sum up.

    Parameters
    ----------
    study:
        What to do.
    folder:
        Where rows go, and where those of an earlier run are.
    scheduler, workers:
        See `workers_of`.
    stop:
        Looked at all the time.
    listener:
        Told after every file written: rows on disk, and tasks in all.

    Raises
    ------
    InputError
        The study names what is not there, or the folder holds another one.
    DeviceUnreachable
        The scheduler cannot be reached, or went away.
    StoppedByOperator
        What was done is on disk.
    """
    stop = StopRequest() if stop is None else stop
    kind = kind_of(study)
    tasks = kind.tasks(study)
    with StudyFolder.opened(folder, study, kind.schema) as store:
        done = store.keys()
        missing = [task for task in tasks if task.key not in done]
        begun = len(tasks) - len(missing)
        listener(begun, len(tasks))
        if missing:
            with workers_of(scheduler, workers) as client:
                shift = _Shift(study, client, store, stop, listener, begun, len(tasks))
                shift.run(missing)
        rows = tuple(store.rows())
    return Outcome(folder, kind, rows)


@dataclass
class _Shift:
    """The tasks that are out with the workers, and the rows that came back and wait for the disk.

    Only this process writes, and it takes every future once: a task that was done twice, because
    the worker that held its result died, still has one row.
    """

    study: Study
    client: Client
    store: StudyFolder
    stop: StopRequest
    listener: Listener
    done: int
    total: int
    held: list[Row] = field(default_factory=list)
    finished: queue.SimpleQueue[tuple[Task, Future]] = field(default_factory=queue.SimpleQueue)

    def run(self, missing: Sequence[Task]) -> None:
        """Do these tasks; however this ends, rows that came are written."""
        content = json.dumps(self.study.as_mapping(), sort_keys=True)
        name = hashlib.sha256(content.encode()).hexdigest()[:16]
        study = self.client.submit(given, self.study, key=f"study-{name}")
        futures = [self._submit(study, task, f"{name} {task.key}") for task in missing]
        try:
            self._collect(len(futures))
        finally:
            self._write()
            self.client.cancel([study, *futures], force=True)

    def _submit(self, study: Future, task: Task, key: str) -> Future:
        future = self.client.submit(work, study, task, key=key)
        future.add_done_callback(lambda done: self.finished.put((task, done)))
        return future

    def _collect(self, out: int) -> None:
        since = time.monotonic()
        while out:
            if self.stop.asked:
                raise StoppedByOperator(self._stopped(out))
            try:
                task, future = self.finished.get(timeout=_LOOK_S)
            except queue.Empty:
                pass
            else:
                self.held.append(self._row(task, future))
                out -= 1
            if time.monotonic() - since > _HOLD_S:
                self._write()
                since = time.monotonic()

    def _row(self, task: Task, future: Future) -> Row:
        if future.status == "cancelled":
            raise DeviceUnreachable(
                "the Dask scheduler went away; what was done is written: give the same command"
                " again when it is back"
            )
        error = future.exception()
        if isinstance(error, KilledWorker):
            return lost(task, f"{error.allowed_failures + 1} workers died over it, one by one")
        if error is not None:
            return lost(task, f"{type(error).__name__}: {error}")
        row: Row = future.result()
        return row

    def _write(self) -> None:
        if self.held:
            self.store.add(self.held)
            self.done += len(self.held)
            self.held = []
            self.listener(self.done, self.total)

    def _stopped(self, out: int) -> str:
        return (
            f"{self.stop.reason}: {self.total - out} of {self.total} tasks are done and written to"
            f" {self.store.path}; the same command goes on from there"
        )
