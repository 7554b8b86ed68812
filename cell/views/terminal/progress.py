"""A run's progress: a bar with the time left in a terminal, a plain line per frame elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn

from cell.sequencer.states import Status
from cell.sequencer.watcher import Watcher


@contextmanager
def run_progress(*, simulated: bool) -> Iterator[Watcher]:
    """A watcher that shows a run on stderr."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _Plainly()
        return
    with Progress(
        TextColumn("[yellow]SIMULATED" if simulated else "[green]REAL ARM"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("{task.description}"),
        console=console,
    ) as bar:
        yield _Bar(bar, bar.add_task("", left="", total=None))


@dataclass
class _Bar(Watcher):
    bar: Progress
    task: TaskID

    def status_changed(self, status: Status) -> None:
        self.bar.update(
            self.task,
            total=status.total,
            completed=status.done + status.skipped,
            description=f"{status.state.value} {status.view}",
            left=f"{_clock(status.left_s)} left",
        )
        if status.event:
            self.bar.console.print(status.event, highlight=False)


class _Plainly(Watcher):
    def status_changed(self, status: Status) -> None:
        if status.event:
            done = f"[{status.done + status.skipped}/{status.total}]"
            sys.stderr.write(f"{done} {status.event}, {_clock(status.left_s)} left\n")
            sys.stderr.flush()


def _clock(seconds: float | None) -> str:
    return "?:??" if seconds is None else f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


@contextmanager
def counted_progress(what: str) -> Iterator[Callable[[int, int], None]]:
    """Report (done, total) of what is being done; silent where nobody looks."""
    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=None)

        def report_progress(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield report_progress
