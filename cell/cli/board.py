"""`cell board`: the board to print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.views.terminal.output import show

if TYPE_CHECKING:
    from cell.storage.files.board_file import AprilGrid


def board(
    board: Annotated[
        str,
        typer.Argument(
            help="ROWSxCOLSxSQUARE_M in inner corners (7x10x0.025), or"
            " charuco:SQUARES_XxSQUARES_YxSQUARE_MxMARKER_M:DICTIONARY; for a .yaml:"
            " aprilgrid:TAGS_XxTAGS_YxTAG_MxGAP_M. Or a cell file, for its board."
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="A .pdf or .svg; Kalibr's target as .yaml.")
    ],
    paper: Annotated[
        str | None,
        typer.Option(help="a4, a3, a2, a1, a0, letter or tabloid; a page to fit without."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Draw the calibration board at scale, with a ruler, and say how to check the print."""
    from cell.storage.files.board_option import parse_board
    from cell.verbs.board import draw_board, how_to_check

    described = parse_board(board)
    if described.type == "aprilgrid" and output.suffix in (".yaml", ".yml"):
        _write_target(described, output, as_json=as_json)
        return
    page_mm = draw_board(described.board(), output, paper)
    result = {"file": str(output), "page_mm": page_mm, "board": described.model_dump()}
    show(how_to_check(described.board(), output, page_mm), result, as_json=as_json)


def _write_target(described: AprilGrid, output: Path, *, as_json: bool) -> None:
    from cell.storage.atomic import write_atomically
    from cell.storage.files.kalibr_target import kalibr_target

    write_atomically(output, kalibr_target(described))
    result = {"file": str(output), "board": described.model_dump()}
    show(f"{output}: Kalibr's target file of this board", result, as_json=as_json)
