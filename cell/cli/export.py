"""`cell export`: the calibrated camera in another program's own format."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.cli.streams import check_output_written
from cell.errors import InputError
from cell.views.terminal.output import say, show


def _formats(begun: str) -> list[str]:
    """The formats that begin so, for Tab in the shell."""
    from cell.verbs.export import FORMATS

    return [name for name in FORMATS if name.startswith(begun)]


def export(
    calibration: Annotated[Path, typer.Argument(help="A calibration.json, or its folder.")],
    tool: Annotated[
        str,
        typer.Option(
            "--format",
            help="The camera for ros, opencv, mrcal, kalibr, colmap, json; its place and the"
            " board's for tf, urdf, ur, abb, moveit, easy_handeye2, text.",
            autocompletion=_formats,
        ),
    ],
    distance: Annotated[
        float | None,
        typer.Option("--distance", help="Metres; needed where the focal length depends on it."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="File (with --views folder) to write; stdout without."),
    ] = None,
    solution: Annotated[
        str | None, typer.Option("--solution", help="Which solution; the best one without.")
    ] = None,
    image_size: Annotated[
        str | None, typer.Option(help="WIDTHxHEIGHT, for a file that does not state it.")
    ] = None,
    frame: Annotated[
        list[str] | None,
        typer.Option(
            help="base=NAME, flange=NAME, camera=NAME or board=NAME: what your tool calls it."
        ),
    ] = None,
    views: Annotated[
        Path | None,
        typer.Option(help="With colmap: a recording whose pictures and poses become a model."),
    ] = None,
    refit: Annotated[
        bool,
        typer.Option(
            "--refit",
            help="Where the format has too few coefficients: its best fit over the picture, with"
            " how far it is off.",
        ),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Hand over the calibrated camera, or its place on the robot, in another tool's format."""
    from cell.storage.atomic import write_atomically
    from cell.storage.files.calibration_place import calibration_file
    from cell.verbs.export import export_calibration, read_calibration

    path = calibration_file(calibration)
    recording = None
    if views is not None:
        from cell.storage.recording import read_recording

        recording = read_recording(views)
    source = read_calibration(path)
    try:
        exported = export_calibration(
            source,
            tool,
            distance_m=distance,
            solution=solution,
            image_size_px=None if image_size is None else _size(image_size),
            frames=dict(_frame(given_text) for given_text in frame or ()),
            views=recording,
            refit=refit,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    for warning in exported.warnings:
        say(f"warning: {warning}")
    if exported.files:
        _write_folder(output, exported.files)
    elif output is not None:
        write_atomically(output, exported.text)
    if output is None and not as_json:
        sys.stdout.write(exported.text)
        check_output_written()
        return
    written = None if output is None else str(output)
    result = {"format": tool, "file": written, "text": exported.text, "warnings": exported.warnings}
    show(f"{tool}: {output}", result, as_json=as_json)


def _write_folder(output: Path | None, files: Mapping[str, str]) -> None:
    from cell.storage.atomic import write_atomically

    if output is None:
        raise InputError("--views makes a folder of files: say which with -o FOLDER")
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"-o {output}: cannot be made: {fault.strerror}; give another") from None
    for name, text in files.items():
        write_atomically(output / name, text)


def _frame(given_text: str) -> tuple[str, str]:
    name, _, given = given_text.partition("=")
    if not given:
        raise InputError(f"--frame {given_text}: must be FRAME=NAME, such as camera=wrist_camera")
    return name.strip(), given.strip()


def _size(given_text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([1-9]\d*)x([1-9]\d*)", given_text)
    if found is None:
        raise InputError(f"--image-size {given_text}: must be WIDTHxHEIGHT, such as 4096x3072")
    return int(found[1]), int(found[2])
