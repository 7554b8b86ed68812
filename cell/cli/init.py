"""`cell init`: a cell file for this bench."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from calib.views import Mount
from cell.cli.json_flag import JsonFlag
from cell.errors import InputError
from cell.views.terminal.output import say, show

RobotDriver = Literal["sim", "ur", "abb"]
CameraDriver = Literal["sim", "gige", "genicam", "robotiq"]
Focus = Literal["auto", "manual", "motorised", "fixed"]


def init(
    folder: Annotated[Path, typer.Argument(help="Where to write cell.yaml.")] = Path(),
    robot: Annotated[RobotDriver | None, typer.Option(help="The arm's driver.")] = None,
    model: Annotated[str | None, typer.Option(help="The arm's model, such as ur5e.")] = None,
    robot_address: Annotated[str | None, typer.Option(help="The controller's address.")] = None,
    camera: Annotated[CameraDriver | None, typer.Option(help="The camera's driver.")] = None,
    camera_address: Annotated[
        str | None, typer.Option(help="The camera's address; the .cti file for genicam.")
    ] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT of its pictures.")] = None,
    pixel_size_um: Annotated[float | None, typer.Option(help="Size of a pixel.")] = None,
    focal_length_mm: Annotated[float | None, typer.Option(help="As the lens says.")] = None,
    focus: Annotated[Focus | None, typer.Option(help="How the lens focuses.")] = None,
    board: Annotated[
        str | None, typer.Option(help="7x10x0.025, or charuco:5x7x0.036x0.018:DICT_6X6_250.")
    ] = None,
    mount: Annotated[Mount | None, typer.Option(help="Where the camera sits.")] = None,
    camera_at: Annotated[
        str | None,
        typer.Option(help="x,y,z,roll,pitch,yaw (m, degrees) of the camera on the flange."),
    ] = None,
    board_at: Annotated[
        str | None,
        typer.Option(help="The same of the board in the base; before the camera at home without."),
    ] = None,
    home: Annotated[str | None, typer.Option(help="Six joint angles, degrees.")] = None,
    distances: Annotated[str | None, typer.Option(help="NEAR,FAR of the board, metres.")] = None,
    name: Annotated[str, typer.Option(help="The cell's name.")] = "my-cell",
    as_json: JsonFlag = False,
) -> None:
    """Write a cell file for this bench, from options or from answers in the terminal."""
    from cell.storage.files.board_words import parse_board
    from cell.verbs.init import Answers, cell_of, write_cell

    robot = robot or _asked("arm: sim, ur or abb", "sim")
    model = model or _asked("the arm's model", "irb140" if robot == "abb" else "ur5e")
    if robot != "sim":
        robot_address = robot_address or _asked("the controller's address", None)
    camera = camera or _asked("camera: sim, gige, genicam or robotiq", "sim")
    if camera != "sim":
        camera_address = camera_address or _asked("the camera's address", None)
    width, height = _numbers("--size", size or _asked("picture size", "2448x2048"), 2, "x")
    told: dict[str, Any] = {
        "board": parse_board(board or _asked("board", "7x10x0.025")).model_dump(),
        "name": name,
        "robot": robot,
        "model": model,
        "robot_address": robot_address,
        "camera": camera,
        "camera_address": camera_address,
        "width": int(width),
        "height": int(height),
        "pixel_size_um": pixel_size_um or float(_asked("pixel size, micrometres", "3.45")),
        "focal_length_mm": focal_length_mm or float(_asked("focal length, mm", "12")),
        "focus": focus or _asked("focus: auto, manual, motorised or fixed", "fixed"),
        "mount": mount or _asked("mount: eye_in_hand or eye_to_hand", "eye_in_hand"),
    }
    places = (("camera_at", camera_at, 6), ("board_at", board_at, 6), ("home_deg", home, 6),
              ("distances_m", distances, 2))  # fmt: skip
    told |= {key: _numbers(key, words, count) for key, words, count in places if words is not None}
    cell = cell_of(Answers(**told))
    path = write_cell(cell, folder)
    text = (
        f"{path}: written. Next: measure `layout` and mend it there; then\n"
        f"  cell doctor {path}\n  cell plan {path}\n  cell run {path.with_name('cell.plan.yaml')}"
        " --dry-run"
    )
    show(text, {"file": str(path), "cell": cell.as_mapping()}, as_json=as_json)


def _asked(question: str, default: str | None) -> Any:
    """The answer from the terminal; the usual one, said aloud, where nobody sits there."""
    if sys.stdin.isatty():
        return typer.prompt(question, default=default, err=True)
    if default is None:
        raise InputError(f"not said: {question}; give it as an option (cell init --help)")
    say(f"not said, taken: {question.partition(':')[0]} {default}")
    return default


def _numbers(name: str, words: str, count: int, separator: str = ",") -> tuple[float, ...]:
    try:
        found = tuple(float(part) for part in words.split(separator))
    except ValueError:
        found = ()
    if len(found) != count:
        raise InputError(f"{name} {words}: must be {count} numbers parted by `{separator}`")
    return found
