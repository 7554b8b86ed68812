"""`cell study`: many simulated runs or many recordings, on all cores or on a cluster."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cell.cli.json_flag import JsonFlag
from cell.errors import EXIT_BAD_ANSWER
from cell.storage.files.results import same_folder
from cell.views.terminal.output import say, show

if TYPE_CHECKING:
    from cell.verbs.study.run import Outcome

_REASONS = 5


def study(
    study: Annotated[Path, typer.Argument(help="A study file.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder of its results; runs/NAME where not given."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Address of a Dask scheduler; this machine's cores else."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Processes on this machine; one a core else."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Run a study, or the rest of one: what is done stays, what failed is tried again."""
    from cell.verbs.study.extra import require_extra

    require_extra()
    from cell.sequencer.stop import StopRequest, signals_ask
    from cell.storage.files.study_file import read_study
    from cell.verbs.study.run import run_study
    from cell.views.terminal.progress import counted_progress

    read, stop = read_study(study), StopRequest()
    folder = output or same_folder(read.file.name)
    with signals_ask(stop), counted_progress("tasks") as listener:
        outcome = run_study(
            read,
            folder,
            scheduler=scheduler,
            workers=workers,
            stop=stop,
            listener=listener,
            say=say,
        )
    if as_json:
        show("", _mapping(outcome), as_json=True)
    else:
        _print(outcome, on_cluster=scheduler is not None)
    if outcome.failed:
        raise typer.Exit(EXIT_BAD_ANSWER)


def _mapping(outcome: Outcome) -> dict[str, Any]:
    failed = [{name: row[name] for name in ("key", "reason", "tries")} for row in outcome.failed]
    return {
        "folder": str(outcome.folder),
        "results": str(outcome.results),
        "failures": str(outcome.failures),
        "tasks": len(outcome.rows) + len(failed),
        "failed": failed,
        **outcome.summary,
    }


def _print(outcome: Outcome, *, on_cluster: bool) -> None:
    from rich.console import Console

    console = Console(highlight=False)
    for table in outcome.tables():
        console.print(table)
    failed = outcome.failed
    for row in failed[:_REASONS]:
        tries = f" ({row['tries']} times)" if row["tries"] > 1 else ""
        where = f" (at {row['worker']})" if on_cluster and row["worker"] else ""
        console.print(f"failed{tries}: {row['key']}: {row['reason']}{where}", markup=False)
    if len(failed) > _REASONS:
        console.print(f"and {len(failed) - _REASONS} more that failed")
    count = f"{len(outcome.rows) + len(failed)} tasks, {len(failed)} failed"
    console.print(f"{count}: {outcome.results}", soft_wrap=True)
    if failed:
        console.print(
            f"Every failure stands in {outcome.failures}; the same command tries them again.",
            soft_wrap=True,
        )
