"""`cell board`: the board to print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cell.cli.json_flag import JsonFlag
from cell.views.terminal.output import show


def board(
    board: Annotated[
        str,
        typer.Argument(
            help="ROWSxCOLSxSQUARE_M in inner corners (7x10x0.025), or"
            " charuco:SQUARES_XxSQUARES_YxSQUARE_MxMARKER_M:DICTIONARY."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="A .pdf or .svg to write.")],
    paper: Annotated[
        str | None,
        typer.Option(help="a4, a3, a2, a1, a0, letter or tabloid; a page to fit without."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Draw the calibration board at scale, with a ruler, and say how to check the print."""
    from cell.storage.files.board_words import parse_board
    from cell.verbs.board import draw_board, how_to_check

    described = parse_board(board)
    page_mm = draw_board(described.board(), output, paper)
    result = {"file": str(output), "page_mm": page_mm, "board": described.model_dump()}
    show(how_to_check(described.board(), output, page_mm), result, as_json=as_json)
