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


_FAMILIES = {"tag36h11": "DICT_APRILTAG_36h11"}
"""OpenCV's names of tag families."""


class AprilGrid(_Part):
    """Kalibr's board of AprilTags, counted in tags; tag 0 is at the bottom left."""

    type: Literal["aprilgrid"]
    tags_x: int = Field(ge=1, le=BOARD_SIDE)
    tags_y: int = Field(ge=1, le=BOARD_SIDE)
    tag_m: Length
    """Side of a tag, its black border included."""
    gap_m: Length
    """White between two tags: Kalibr's `tagSpacing` times `tagSize`."""
    family: Literal["tag36h11"] = "tag36h11"

    @model_validator(mode="after")
    def _countable(self) -> Self:
        if self.tags_x * self.tags_y < 2:
            raise ValueError("has one tag; two and more show where its corners are")
        if self.gap_m > self.tag_m:
            raise ValueError("gap_m is wider than a tag")
        return _checked(self, 4 * self.tags_x * self.tags_y)

    def board(self) -> Board:
        """The board as the calibration knows it: the corners of its tags."""
        return Board(
            "aprilgrid",
            2 * self.tags_y,
            2 * self.tags_x,
            self.tag_m,
            dictionary=_FAMILIES[self.family],
            gap_m=self.gap_m,
        )


BoardFile = Annotated[Chessboard | Charuco | AprilGrid, Field(discriminator="type")]


def board_file(board: Board) -> Chessboard | Charuco | AprilGrid:
    """A board in the words of the files."""
    if board.kind == "aprilgrid":
        return AprilGrid(
            type="aprilgrid",
            tags_x=board.cols // 2,
            tags_y=board.rows // 2,
            tag_m=board.square_m,
            gap_m=board.gap_m or 0.0,
        )
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
