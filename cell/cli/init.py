"""`cell init`: a cell file for this bench."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from calib.mount import Mount
from cell.cli.json_flag import JsonFlag
from cell.errors import InputError
from cell.verbs.init.answers import CameraDriver, Focus, RobotDriver
from cell.views.terminal.output import say, show

if TYPE_CHECKING:
    from cell.verbs.init.interview import Question


def init(
    folder: Annotated[Path, typer.Argument(help="Where to write cell.yaml.")] = Path(),
    robot: Annotated[RobotDriver | None, typer.Option(help="The arm's driver.")] = None,
    model: Annotated[str | None, typer.Option(help="The arm's model, such as ur5e.")] = None,
    robot_address: Annotated[str | None, typer.Option(help="The controller's address.")] = None,
    payload_kg: Annotated[float | None, typer.Option(help="Mass of camera and bracket.")] = None,
    camera: Annotated[CameraDriver | None, typer.Option(help="The camera's driver.")] = None,
    camera_address: Annotated[
        str | None, typer.Option(help="The camera's address; the .cti file for genicam.")
    ] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT of its pictures.")] = None,
    pixel_size_um: Annotated[float | None, typer.Option(help="Size of a pixel.")] = None,
    focal_length_mm: Annotated[float | None, typer.Option(help="As the lens' barrel says.")] = None,
    focus: Annotated[Focus | None, typer.Option(help="How the lens focuses.")] = None,
    board: Annotated[
        str | None, typer.Option(help="7x10x0.025, or charuco:5x7x0.036x0.018:DICT_6X6_250.")
    ] = None,
    mount: Annotated[Mount | None, typer.Option(help="Where the camera sits.")] = None,
    camera_at: Annotated[
        str | None,
        typer.Option(
            help="x,y,z,roll,pitch,yaw (m, degrees) of the camera on the flange; of the board with"
            " eye_to_hand."
        ),
    ] = None,
    board_at: Annotated[
        str | None,
        typer.Option(
            help="The same of the board in the base (the camera with eye_to_hand); straight before"
            " the camera at home without."
        ),
    ] = None,
    home: Annotated[str | None, typer.Option(help="Six joint angles, degrees.")] = None,
    distances: Annotated[str | None, typer.Option(help="NEAR,FAR of the board, metres.")] = None,
    workspace: Annotated[
        str | None,
        typer.Option(help="x,y,z,x,y,z: opposite corners of the box the arm stays inside, metres."),
    ] = None,
    no_workspace_because: Annotated[
        str | None, typer.Option(help="Why there is nothing to run into, in its place.")
    ] = None,
    keep_out: Annotated[
        list[str] | None,
        typer.Option(help="NAME:x,y,z,x,y,z of a thing to stay out of, once for each; or none."),
    ] = None,
    name: Annotated[str, typer.Option(help="The cell's name.")] = "my-cell",
    as_json: JsonFlag = False,
) -> None:
    """Write a cell file for this bench, from options or from answers in the terminal."""
    from cell.verbs.init.cell_text import cell_of, write_cell
    from cell.verbs.init.interview import interview

    options = {
        "robot": robot,
        "model": model,
        "robot_address": robot_address,
        "payload_kg": payload_kg,
        "camera": camera,
        "camera_address": camera_address,
        "size_px": size,
        "pixel_size_um": pixel_size_um,
        "focal_length_mm": focal_length_mm,
        "focus": focus,
        "board": board,
        "mount": mount,
        "camera_at": camera_at,
        "board_at": board_at,
        "home_deg": home,
        "distances_m": distances,
        "workspace": workspace,
        "no_workspace_because": no_workspace_because,
        "keep_out": "; ".join(keep_out) if keep_out else None,
        "name": name,
    }
    answers = interview({k: str(v) for k, v in options.items() if v is not None}, _asked)
    cell = cell_of(answers)
    path = write_cell(cell, folder)
    text = (
        f"{path}: written. Measure `layout` with a tape and mend it there; then\n"
        f"  cell doctor {path}\n  cell plan {path}\n"
        f"  cell run {path.with_name('cell.plan.yaml')} --dry-run"
    )
    show(text, {"file": str(path), "cell": cell.as_mapping()}, as_json=as_json)


def _asked(question: Question) -> str:
    """The answer from the terminal; where nobody sits there the usual one, with a word."""
    if not sys.stdin.isatty():
        if question.usual is None:
            raise InputError(f"{question.option} is needed: {question.prompt}")
        say(f"{question.option} {question.usual} (not given)")
        return question.usual
    while True:
        text = str(typer.prompt(question.prompt, default=question.usual, err=True))
        try:
            question.read(text)
        except InputError as fault:
            say(str(fault))
        else:
            return text
