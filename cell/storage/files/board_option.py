"""A board as the command line's option `--board` gives it."""

from __future__ import annotations

from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from cell.errors import InputError
from cell.storage.files.board_file import BoardFile
from cell.storage.files.kalibr_target import read_kalibr_target

_BOARD: TypeAdapter[BoardFile] = TypeAdapter(BoardFile)
EXAMPLES = "7x10x0.025, charuco:5x7x0.036x0.018:DICT_6X6_250 or aprilgrid:6x6x0.088x0.0264"


def parse_board(text: str) -> BoardFile:
    """ROWSxCOLSxSQUARE_M, charuco:... or aprilgrid:..., see `EXAMPLES`; or Kalibr's target file.

    Raises
    ------
    InputError
        It cannot be read, or is no board.
    """
    if text.endswith((".yaml", ".yml")):
        return read_kalibr_target(Path(text))
    try:
        return _BOARD.validate_python(_mapping(text))
    except ValidationError as invalid:
        faults = "; ".join(f"{e['loc'][-1]}: {e['msg']}" for e in invalid.errors())
        raise InputError(f"--board {text}: {faults}; give it like {EXAMPLES}") from None
    except ValueError:
        raise InputError(f"--board {text}: is not understood; give it like {EXAMPLES}") from None


def _mapping(text: str) -> dict[str, object]:
    if text.startswith("charuco:"):
        sizes, _, dictionary = text.removeprefix("charuco:").partition(":")
        squares_x, squares_y, square, marker = sizes.split("x")
        return {
            "type": "charuco",
            "squares_x": int(squares_x),
            "squares_y": int(squares_y),
            "square_m": float(square),
            "marker_m": float(marker),
            "dictionary": dictionary or "DICT_6X6_250",
        }
    if text.startswith("aprilgrid:"):
        tags_x, tags_y, tag, gap = text.removeprefix("aprilgrid:").split("x")
        return {
            "type": "aprilgrid",
            "tags_x": int(tags_x),
            "tags_y": int(tags_y),
            "tag_m": float(tag),
            "gap_m": float(gap),
        }
    rows, cols, square = text.split("x")
    return {"type": "chessboard", "rows": int(rows), "cols": int(cols), "square_m": float(square)}
