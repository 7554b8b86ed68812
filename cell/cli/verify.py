"""`cell verify`: whether an old calibration still holds for the camera as it is now."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.errors import InputError
from cell.storage.files.results import new_folder
from cell.views.terminal.output import say, say_error, show

if TYPE_CHECKING:
    from cell.storage.recording import Recording
    from cell.verbs.verify.length import KnownLength


def verify(
    source: Annotated[
        Path, typer.Argument(help="A plan to run, or a recording taken since the calibration.")
    ],
    calibration: Annotated[
        Path, typer.Argument(help="The old calibration.json, its folder, or its recording.")
    ],
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Simulated arm and camera in place of the real ones.")
    ] = False,
    views: Annotated[
        int, typer.Option(help="How many of the plan's views to take: the most informative ones.")
    ] = 8,
    length_m: Annotated[
        float | None,
        typer.Option("--length-m", help="A length on the board, measured by other means."),
    ] = None,
    length_sigma_m: Annotated[
        float, typer.Option("--length-sigma-m", min=0, help="One sigma of that length.")
    ] = 0.0,
    corners: Annotated[
        str | None, typer.Option(help="Its two ends, ROW,COL:ROW,COL, such as 0,0:0,9.")
    ] = None,
    tolerance_mm: Annotated[
        float | None,
        typer.Option(
            help="Error at the work piece that matters: what changed by less is still good, and a"
            " check that could overlook more cannot say. Without it any change counts that is more"
            " than chance, and the check must be able to notice 1 mm.",
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for the results.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Check an old calibration against the camera as it is now; exit status 1 unless it holds."""
    from cell.verbs.verify.messages import text
    from cell.verbs.verify.verb import verify_into
    from cell.views.terminal.progress import counted_progress

    if tolerance_mm is not None and not tolerance_mm > 0:
        raise InputError(f"--tolerance-mm {tolerance_mm:g}: must be above 0")
    known = _known(length_m, length_sigma_m, corners)
    recording, folder = _recording(source, calibration, dry_run, views, output)
    with counted_progress("finding corners") as progress:
        found = verify_into(
            recording,
            calibration,
            folder,
            known=known,
            tolerance_m=None if tolerance_mm is None else 1e-3 * tolerance_mm,
            progress=progress,
        )
    result = found.content.model_dump(mode="json", by_alias=True)
    show(f"{text(found.content)}\nreport: {found.page}", result, as_json=as_json)
    raise typer.Exit(0 if found.content.verdict in ("good", "within_tolerance") else 1)


def _recording(
    source: Path, calibration: Path, dry_run: bool, views: int, output: Path | None
) -> tuple[Recording, Path]:
    """The recording to look at, taken now where `source` is a plan, and where results go."""
    from cell.storage.files.results import results_folder
    from cell.storage.recording import read_recording

    if source.is_dir():
        if dry_run:
            raise InputError("--dry-run goes with a plan; a recording has been taken already")
        recording = read_recording(source)
        return recording, output or results_folder(recording.path, recording.name, "verify")
    folder = output or new_folder(f"{source.name.split('.')[0]}-verify")
    _run(source, calibration, dry_run, views, folder)
    return read_recording(folder), folder


def _run(source: Path, calibration: Path, dry_run: bool, views: int, folder: Path) -> None:
    """Take the plan's most informative views; leaves with the run's own exit status if it fails."""
    from cell.storage.files.plan_file import read_plan
    from cell.verbs.run import Outcome, record
    from cell.verbs.verify.short_plan import shortened
    from cell.verbs.verify.verb import read_old

    old, _ = read_old(calibration)
    plan = shortened(old, read_plan(source), views)
    result = record(plan, folder, dry_run=dry_run, resume=False)
    for view, reason in result.skipped.items():
        say(f"skipped view {view}: {reason}")
    if not Outcome.of(result, folder).complete:
        say_error(result.reason or result.finish.text)
        raise typer.Exit(result.finish.exit_status)


def _known(length_m: float | None, sigma_m: float, corners: str | None) -> KnownLength | None:
    from cell.verbs.verify.length import KnownLength

    if length_m is None and corners is None:
        return None
    if length_m is None or corners is None:
        raise InputError("--length-m and --corners go together: a length, and its two ends")
    if not length_m > 0:
        raise InputError(f"--length-m {length_m:g}: must be above 0")
    try:
        first, second = (tuple(int(n) for n in end.split(",")) for end in corners.split(":"))
        (row_a, col_a), (row_b, col_b) = first, second
    except ValueError:
        raise InputError(
            f"--corners {corners}: is not understood; give ROW,COL:ROW,COL such as 0,0:0,9"
        ) from None
    return KnownLength(length_m, sigma_m, ((row_a, col_a), (row_b, col_b)))
