"""`cell bootstrap`: find camera and board of a roughly known cell, and plan the rest."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from cell.cli.json_flag import JsonFlag
from cell.errors import InputError
from cell.storage.files.results import new_folder
from cell.views.terminal.output import say, say_error, show

_NO_BOARD = (
    " Nothing was moved. Drive the arm by hand until the whole board is in the picture, sharp, and"
    " about half as wide as it, then start again."
)


def bootstrap(
    cell: Annotated[Path, typer.Argument(help="A cell file whose layout is only roughly known.")],
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Simulated arm and camera in place of the real ones.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder of the recording, the new cell and its plan."),
    ] = None,
    start_deg: Annotated[
        str | None,
        typer.Option(
            "--start-deg", help="With --dry-run: where the arm stands, as six angles with commas."
        ),
    ] = None,
    mount_mm: Annotated[
        float, typer.Option(min=0, help="How far layout.mounted may be off.")
    ] = 50.0,
    mount_deg: Annotated[
        float, typer.Option(min=0, max=30, help="How far layout.mounted may be turned.")
    ] = 10.0,
    fixed_mm: Annotated[
        float, typer.Option(min=0, help="How far the place in layout.fixed may be off.")
    ] = 200.0,
    reach_mm: Annotated[
        float,
        typer.Option(
            min=0, help="Without a layout: how far camera or board may be from the flange's centre."
        ),
    ] = 150.0,
    as_json: JsonFlag = False,
) -> None:
    """Find camera and board by a few small, slow moves, and plan the rest.

    Before: drive the arm by hand so that the whole board is in the picture.
    """
    from cell.verbs.bootstrap import Bootstrap, LayoutUncertainty
    from cell.views.terminal.progress import run_progress

    start = _angles(start_deg, dry_run)
    name = cell.name.split(".")[0]
    recording = output or new_folder(f"{name}-bootstrap")
    reported = LayoutUncertainty(
        1e-3 * mount_mm, math.radians(mount_deg), 1e-3 * fixed_mm, reach_m=1e-3 * reach_mm
    )
    task = Bootstrap.of(cell, recording, output or cell.parent, reported)
    devices = task.devices(dry_run=dry_run, start_deg=start)
    say(f"{'SIMULATED' if dry_run else 'real'} arm and camera; recording {recording}")
    with run_progress(simulated=dry_run) as terminal:
        done = task.run(devices, simulated=dry_run, watchers=(terminal,))
    mapping: dict[str, Any] = {
        "finish": done.result.finish.name.lower(),
        "reason": done.result.reason or None,
        "recording": str(recording),
        "frames": done.result.frames,
    }
    if done.found is None:
        show(f"{done.result.finish.text}: nothing found", mapping, as_json=as_json)
        say_error(done.result.reason + ("" if done.result.frames else _NO_BOARD))
        raise typer.Exit(done.result.finish.exit_status)
    views = task.write(done)
    mapping |= {
        "found": done.found.as_mapping(),
        "cell": str(task.found_path),
        "plan": str(task.plan_path),
        "views": views,
    }
    simulated = " --dry-run" if dry_run else ""
    lines = [
        *done.found.lines(),
        f"{task.found_path}: the cell as found",
        f"{task.plan_path}: {views} views; now: cell run {task.plan_path}{simulated}",
    ]
    show("\n".join(lines), mapping, as_json=as_json)


def _angles(text: str | None, dry_run: bool) -> tuple[float, ...] | None:
    if text is None:
        return None
    if not dry_run:
        raise InputError("--start-deg goes with --dry-run: a real arm stands where it stands")
    try:
        angles = tuple(float(part) for part in text.split(","))
    except ValueError:
        angles = ()
    if len(angles) != 6:
        raise InputError(f"--start-deg: {text!r} is not six angles: 0,-90,90,-90,-90,0")
    return angles
