"""A board as the command line's option `--board` gives it."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from cell.errors import InputError
from cell.storage.files.board_file import BoardFile
from cell.storage.files.kalibr_target import kalibr_board
from cell.storage.files.yaml_model import parse_model, read_mapping

_BOARD: TypeAdapter[BoardFile] = TypeAdapter(BoardFile)


class _WithBoard(BaseModel):
    """A cell file or the header of a recording, of which only the board matters here."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    board: BoardFile


EXAMPLES = "7x10x0.025, charuco:5x7x0.036x0.018:DICT_6X6_250 or aprilgrid:6x6x0.088x0.0264"


def parse_board(text: str) -> BoardFile:
    """ROWSxCOLSxSQUARE_M, charuco:... or aprilgrid:..., see `EXAMPLES`; or a file that has one.

    Such a file is a cell file, a `recording.yaml` or Kalibr's target file.

    Raises
    ------
    InputError
        It cannot be read, or is no board.
    """
    if text.endswith((".yaml", ".yml")):
        return _in_file(Path(text))
    try:
        return _BOARD.validate_python(_mapping(text))
    except ValidationError as invalid:
        faults = "; ".join(f"{e['loc'][-1]}: {e['msg']}" for e in invalid.errors())
        raise InputError(f"--board {text}: {faults}; give it like {EXAMPLES}") from None
    except ValueError:
        raise InputError(f"--board {text}: is not understood; give it like {EXAMPLES}") from None


def _in_file(path: Path) -> BoardFile:
    data = read_mapping(path)
    if "board" in data:
        return parse_model(path, data, _WithBoard).board
    return kalibr_board(path, data)


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
