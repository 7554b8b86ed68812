"""A study from its file to its rows: what is missing is done, what is done stays."""

from __future__ import annotations

import hashlib
import json
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from distributed import Client, Future, KilledWorker
from rich.table import Table

from cell.errors import StoppedByOperator
from cell.sequencer.stop import StopRequest
from cell.storage.files.study_file import Study
from cell.verbs.study.cluster import workers_of
from cell.verbs.study.folder import FAILURES, RESULTS, StudyFolder
from cell.verbs.study.kinds import Kind, Row, Task, kind_of
from cell.verbs.study.work import given, lost, work
from drivers.errors import DeviceUnreachable

_HOLD_S = 1.0
"""A row waits at most so long for others to share its file."""
_LOOK_S = 0.1
_FETCH_S = 10.0
_ASK_S = 5.0

Listener = Callable[[int, int], None]


@dataclass(frozen=True)
class Outcome:
    """A study all of whose tasks were tried.

    Attributes
    ----------
    folder, kind:
        Where it is, and what it is.
    rows:
        Of the tasks that are done.
    failed:
        The last failure of each of the others, with `tries`.
    """

    folder: Path
    kind: Kind
    rows: tuple[Row, ...]
    failed: tuple[Row, ...]

    @property
    def results(self) -> Path:
        """Folder of the Parquet files."""
        return self.folder / RESULTS

    @property
    def failures(self) -> Path:
        """Folder of those of what failed, now or before."""
        return self.folder / FAILURES

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """What the rows say, by the kind of study."""
        return self.kind.summary(self.rows)

    def tables(self) -> Sequence[Table]:
        """The summary for people."""
        return self.kind.tables(self.summary)


def run_study(
    study: Study,
    folder: Path,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    stop: StopRequest | None = None,
    listener: Listener = lambda done, total: None,
    say: Callable[[str], None] = lambda text: None,
) -> Outcome:
    """Do all tasks of a study that are not done yet, those that failed before too, and sum up.

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
        Called after every file written: tasks tried, and tasks in all.
    say:
        Called with what is tried again, and that no worker is left.

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
    keys = {task.key for task in tasks}
    with StudyFolder.opened(folder, study, kind.schema) as store:
        done = store.done_keys()
        missing = [task for task in tasks if task.key not in done]
        again = [row for row in store.failed() if row["key"] in keys]
        if again:
            say(_tried_again(again, folder))
        begun = len(tasks) - len(missing)
        listener(begun, len(tasks))
        if missing:
            with workers_of(scheduler, workers) as client:
                shift = _Shift(
                    study, client, scheduler, store, stop, listener, say, begun, len(tasks)
                )
                shift.run(missing)
        failed = tuple(row for row in store.failed() if row["key"] in keys)
        return Outcome(folder, kind, tuple(store.done()), failed)


def _tried_again(rows: Sequence[Row], folder: Path) -> str:
    count = "1 task" if len(rows) == 1 else f"{len(rows)} tasks"
    return (
        f"{count} that failed before will be tried again; the reasons stay in {folder / FAILURES}"
    )


@dataclass
class _Shift:
    """The tasks that are out with the workers, and the rows that came back and wait for the disk.

    Only this process writes, and it takes every future once: a task that was done twice, because
    the worker that held its result died, still has one row.
    """

    study: Study
    client: Client
    scheduler: str | None
    store: StudyFolder
    stop: StopRequest
    listener: Listener
    say: Callable[[str], None]
    done: int
    total: int
    deserted: bool = False
    held: list[Row] = field(default_factory=list)
    futures: list[Future] = field(default_factory=list)
    finished: queue.SimpleQueue[tuple[Task, Future]] = field(default_factory=queue.SimpleQueue)

    def run(self, missing: Sequence[Task]) -> None:
        """Do these tasks; however this ends, rows that came are written.

        A scheduler holds a death against every task that the worker had, running or not. Those it
        gave up are done again with no other task about: only one that kills its workers then fails.
        """
        content = json.dumps(self.study.as_mapping(), sort_keys=True)
        name = hashlib.sha256(content.encode()).hexdigest()[:16]
        study = self.client.submit(given, self.study, key=f"study-{name}")
        try:
            for suspect, _ in self._round(study, missing, name):
                for task, error in self._round(study, [suspect], f"{name} alone"):
                    self.held.append(lost(task, _killed(error)))
        finally:
            self._write()
            self.client.cancel([study, *self.futures], force=True)

    def _round(
        self, study: Future, tasks: Sequence[Task], name: str
    ) -> list[tuple[Task, KilledWorker]]:
        """Have tasks done; those whose workers died too often come back, the others as rows."""
        self.futures += [self._submit(study, task, f"{name} {task.key}") for task in tasks]
        killed, out = [], len(tasks)
        since = asked = time.monotonic()
        while out:
            if self.stop.asked:
                raise StoppedByOperator(self._stopped())
            try:
                task, future = self.finished.get(timeout=_LOOK_S)
            except queue.Empty:
                pass
            else:
                came = self._came(task, future)
                out -= came is not None
                if isinstance(came, KilledWorker):
                    killed.append((task, came))
                elif came is not None:
                    self.held.append(came)
            if time.monotonic() - since > _HOLD_S:
                self._write()
                since = time.monotonic()
            if time.monotonic() - asked > _ASK_S:
                self._count_workers(out)
                asked = time.monotonic()
        return killed

    def _count_workers(self, waiting: int) -> None:
        """Say so where none is left; those of this machine come back by themselves."""
        if self.scheduler is None or self.client.status != "running":
            return
        with suppress(OSError):
            deserted = not self.client.nthreads()
            if deserted and not self.deserted:
                self.say(_no_workers(self.scheduler, waiting))
            self.deserted = deserted

    def _submit(self, study: Future, task: Task, key: str) -> Future:
        future = self.client.submit(work, study, task, key=key)
        future.add_done_callback(lambda done: self.finished.put((task, done)))
        return future

    def _came(self, task: Task, future: Future) -> Row | KilledWorker | None:
        """What a future that is over holds; None where that was lost with its worker meanwhile."""
        try:
            row: Row = future.result(timeout=_FETCH_S)
        except TimeoutError:
            self.finished.put((task, future))
            return None
        except KilledWorker as error:
            return error
        except Exception as error:
            if future.status != "error":
                raise DeviceUnreachable(
                    "the Dask scheduler went away; what was done is written: give the same command"
                    " again when it is back"
                ) from None
            return lost(task, f"{type(error).__name__}: {error}")
        return row

    def _write(self) -> None:
        if self.held:
            self.store.add(self.held)
            self.done += len(self.held)
            self.held = []
            self.listener(self.done, self.total)

    def _stopped(self) -> str:
        return (
            f"{self.stop.reason}: {self.done + len(self.held)} of {self.total} tasks are done and"
            f" written to {self.store.path}; the same command goes on from there"
        )


def _no_workers(scheduler: str, waiting: int) -> str:
    return (
        f"{scheduler} has no workers any more, {waiting} tasks wait: start `dask worker"
        f" {scheduler}` somewhere, or stop with Ctrl-C and go on later"
    )


def _killed(error: KilledWorker) -> str:
    """Of a task that ran alone."""
    return (
        f"it kills its workers: {error.allowed_failures + 1} died while nothing else ran, the last"
        f" at {error.last_worker.address}; want of memory, or a crash in compiled code"
    )
