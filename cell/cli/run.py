"""`cell run`: move, grab and log, then calibrate, diagnose and report."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.errors import EXIT_BAD_ANSWER, EXIT_DONE, InputError
from cell.storage.defaults import DRY_RUN_PLAN
from cell.storage.files.results import new_folder
from cell.views.page.address import DEFAULT
from cell.views.terminal.output import say, say_error, show


def run(
    plan: Annotated[Path | None, typer.Argument(help="The plan; a dry run has a default.")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Simulated arm and camera in place of the real ones.")
    ] = False,
    peers: Annotated[
        bool,
        typer.Option(
            "--peers",
            help="With --dry-run: through the real drivers, to simulated devices that speak the"
            " real ones' protocols on loopback. Takes as long as a real run.",
        ),
    ] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder of the recording and results.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the recording in that folder.")
    ] = False,
    record_only: Annotated[
        bool, typer.Option("--record-only", help="Do not calibrate and diagnose afterwards.")
    ] = False,
    page: Annotated[
        str | None,
        typer.Option(
            "--page",
            metavar="[HOST:PORT]",
            help=f"Show the run in a browser, with Pause, Skip and Stop; {DEFAULT} where no"
            " address is given. An address that other computers reach needs the token that is"
            " printed with it.",
        ),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Move, grab and log every view of a plan, then calibrate, diagnose and report."""
    from cell.sequencer.states import Finish
    from cell.storage.files.plan_file import read_plan
    from cell.verbs.run import Outcome, evaluate, record, shown_on_page, truth_of

    if peers and not dry_run:
        raise InputError("--peers goes with --dry-run: cell run PLAN.yaml --dry-run --peers")
    path = _plan_path(plan, dry_run)
    folder = _folder(path, output, resume)
    read = read_plan(path)
    with shown_on_page(page, read, folder, dry_run=dry_run) as live:

        def report_progress(text: str) -> None:
            say(text)
            if live is not None:
                live.say(text)

        result = record(read, folder, dry_run=dry_run, resume=resume, peers=peers, live=live)
        outcome = Outcome.of(result, folder)
        for view, reason in result.skipped.items():
            say(f"skipped view {view}: {reason}")
        if outcome.complete and not record_only:
            truth = truth_of(path) if dry_run else None
            outcome = evaluate(
                outcome, result, simulated=dry_run, truth=truth, report_progress=report_progress
            )
        if live is not None:
            live.ended(outcome.text, outcome.files)
    report = outcome.mapping.get("report")
    text = f"{outcome.text}\nreport: {report}" if report else outcome.text
    show(text, outcome.mapping, as_json=as_json)
    if result.reason:
        say_error(result.reason)
    if not outcome.complete and result.finish is not Finish.BAD_INPUT:
        flags = {"--dry-run": dry_run, "--peers": peers, "--record-only": record_only}
        command = ["cell", "run", str(path), "-o", str(folder), *(f for f in flags if flags[f])]
        command += [] if page is None else ["--page", page]
        say(f"when that is mended, go on with: {shlex.join(command)} --resume")
    if outcome.undetermined is not None:
        say_error(outcome.undetermined)
    undetermined = EXIT_BAD_ANSWER if outcome.undetermined is not None else EXIT_DONE
    raise typer.Exit(result.finish.exit_status or undetermined)


def _plan_path(plan: Path | None, dry_run: bool) -> Path:
    if plan is not None:
        return plan
    if not dry_run:
        raise InputError("name the plan to run, or try the simulated cell: cell run --dry-run")
    return DRY_RUN_PLAN


def _folder(plan: Path, output: Path | None, resume: bool) -> Path:
    if output is not None:
        return output
    if resume:
        raise InputError("--resume needs -o with the folder of the recording to go on with")
    return new_folder(plan.name.split(".")[0])
