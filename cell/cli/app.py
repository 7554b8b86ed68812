"""The `cell` command: its verbs, and every error as words and an exit status."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from cell.cli.board import board
from cell.cli.bootstrap import bootstrap
from cell.cli.calibrate import calibrate
from cell.cli.compare import compare
from cell.cli.diagnose import diagnose
from cell.cli.doctor import doctor
from cell.cli.export import export
from cell.cli.importing import import_
from cell.cli.init import init
from cell.cli.page_option import WithPage
from cell.cli.plan import plan
from cell.cli.run import run
from cell.cli.simulate import simulate
from cell.cli.streams import lost_output, make_patient
from cell.cli.study import study
from cell.cli.unforeseen import arguments_of
from cell.cli.verify import verify
from cell.compiled import prepare
from cell.errors import EXIT_BAD_ANSWER, EXIT_DONE, EXIT_OPERATOR, exit_status_of
from cell.views.terminal.output import keep_log, say, say_error

app = typer.Typer(
    name="cell",
    help="Calibrate a camera on a robot, and name the physics a plain model leaves out.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # boxes and colours would read markdown's parser first, longer than all the rest takes
    rich_markup_mode=None,
    context_settings={"max_content_width": 110, "help_option_names": ["-h", "--help"]},
)
VERBS: dict[str, Callable[..., None]] = {
    "run": run,
    "bootstrap": bootstrap,
    "plan": plan,
    "simulate": simulate,
    "calibrate": calibrate,
    "diagnose": diagnose,
    "compare": compare,
    "verify": verify,
    "export": export,
    "import": import_,
    "study": study,
    "doctor": doctor,
    "init": init,
    "board": board,
}


def _say_version(asked: bool) -> None:
    """Print the version and leave."""
    if asked:
        from importlib.metadata import version

        sys.stdout.write(f"calibration-cell {version('calibration-cell')}\n")
        raise typer.Exit


@app.callback()
def before_every_verb(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="Say the version."),
    ] = False,
    verbose: Annotated[
        bool, typer.Option("-v", "--verbose", help="Say more of what is done, on stderr.")
    ] = False,
    log: Annotated[
        Path | None, typer.Option("--log", help="Write every message to a file, too.")
    ] = None,
) -> None:
    """Calibrate a camera on a robot, and name the physics a plain model leaves out."""
    if verbose:
        logging.getLogger().setLevel(logging.INFO)
    if log is not None:
        keep_log(log)


for name, verb in VERBS.items():
    app.command(name, cls=WithPage if verb is run else None)(verb)


def main() -> None:
    """Run the command line and leave with the contract's exit status."""
    make_patient()
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    prepare(sys.argv[1:])
    status = _status(app)
    reason = lost_output()
    if reason:
        say_error(f"the result could not be printed: {reason}")
    sys.exit(status)


def _status(program: Callable[[], object]) -> int:
    """Run the program; every error becomes words and an exit status."""
    try:
        program()
    except SystemExit as left:
        return left.code if isinstance(left.code, int) else EXIT_DONE
    except KeyboardInterrupt:
        say("stopped")
        return EXIT_OPERATOR
    except Exception as error:
        status = exit_status_of(error)
        say_error(arguments_of(error) if status is None else str(error))
        return EXIT_BAD_ANSWER if status is None else status
    return EXIT_DONE
