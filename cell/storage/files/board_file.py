"""The calibration board as cell files and recordings describe it."""

from __future__ import annotations

from typing import Annotated, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, model_validator

from calib.views import Board
from cell.storage.incoming.limits import BOARD_CORNERS, BOARD_SIDE, DISTANCE_M


class _Part(BaseModel):
    """Recordings come from elsewhere too: keys this program does not know are kept."""

    model_config = ConfigDict(frozen=True, extra="allow", use_attribute_docstrings=True)


Length = Annotated[float, Field(ge=1e-6, le=DISTANCE_M)]
Described = TypeVar("Described", bound=_Part)


def _checked(board: Described, corners: int) -> Described:
    if corners > BOARD_CORNERS:
        raise ValueError(f"has {corners} corners; a board has at most {BOARD_CORNERS}")
    return board


class Chessboard(_Part):
    """A chessboard, counted in inner corners."""

    type: Literal["chessboard"]
    rows: int = Field(ge=2, le=BOARD_SIDE)
    cols: int = Field(ge=2, le=BOARD_SIDE)
    square_m: Length

    @model_validator(mode="after")
    def _countable(self) -> Self:
        return _checked(self, self.rows * self.cols)

    def board(self) -> Board:
        """The board as the calibration knows it."""
        return Board("chessboard", self.rows, self.cols, self.square_m)


class Charuco(_Part):
    """A ChArUco board, counted in squares."""

    type: Literal["charuco"]
    squares_x: int = Field(ge=3, le=BOARD_SIDE)
    squares_y: int = Field(ge=3, le=BOARD_SIDE)
    square_m: Length
    marker_m: Length
    dictionary: str

    @model_validator(mode="after")
    def _countable(self) -> Self:
        return _checked(self, (self.squares_x - 1) * (self.squares_y - 1))

    def board(self) -> Board:
        """The board as the calibration knows it: its inner corners."""
        return Board(
            "charuco",
            self.squares_y - 1,
            self.squares_x - 1,
            self.square_m,
            self.marker_m,
            self.dictionary,
        )


BoardFile = Annotated[Chessboard | Charuco, Field(discriminator="type")]


def board_file(board: Board) -> Chessboard | Charuco:
    """A board in the words of the files."""
    if board.kind == "chessboard":
        return Chessboard(
            type="chessboard", rows=board.rows, cols=board.cols, square_m=board.square_m
        )
    return Charuco.model_validate(
        {
            "type": "charuco",
            "squares_x": board.cols + 1,
            "squares_y": board.rows + 1,
            "square_m": board.square_m,
            "marker_m": board.marker_m,
            "dictionary": board.dictionary,
        }
    )
