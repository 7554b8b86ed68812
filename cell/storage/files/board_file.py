"""The calibration board as cell files and recordings describe it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat

from calib.views import Board


class _Part(BaseModel):
    """Recordings come from elsewhere too: keys this program does not know are kept."""

    model_config = ConfigDict(frozen=True, extra="allow", use_attribute_docstrings=True)


class Chessboard(_Part):
    """A chessboard, counted in inner corners."""

    type: Literal["chessboard"]
    rows: int = Field(ge=2)
    cols: int = Field(ge=2)
    square_m: PositiveFloat

    def board(self) -> Board:
        """The board as the calibration knows it."""
        return Board("chessboard", self.rows, self.cols, self.square_m)


class Charuco(_Part):
    """A ChArUco board, counted in squares."""

    type: Literal["charuco"]
    squares_x: int = Field(ge=3)
    squares_y: int = Field(ge=3)
    square_m: PositiveFloat
    marker_m: PositiveFloat
    dictionary: str

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
