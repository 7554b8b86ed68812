"""Kalibr's target file: the board in its words, read and written."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError
from ruamel.yaml.comments import CommentedMap

from cell.errors import InputError
from cell.storage.files.board_file import AprilGrid, Chessboard
from cell.storage.files.yaml_model import parse_model


class _Target(BaseModel):
    """What Kalibr knows by its `target_type`; further keys are let be."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class _AprilGrid(_Target):
    """An AprilGrid."""

    target_type: Literal["aprilgrid"]
    tagCols: int  # noqa: N815  Kalibr's own key
    tagRows: int  # noqa: N815
    tagSize: float  # noqa: N815
    tagSpacing: float  # noqa: N815

    def board(self) -> AprilGrid:
        """`tagSpacing` is the gap as a share of `tagSize`."""
        return AprilGrid(
            type="aprilgrid",
            tags_x=self.tagCols,
            tags_y=self.tagRows,
            tag_m=self.tagSize,
            gap_m=self.tagSpacing * self.tagSize,
        )


class _Checkerboard(_Target):
    """A chessboard."""

    target_type: Literal["checkerboard"]
    targetCols: int  # noqa: N815
    targetRows: int  # noqa: N815
    rowSpacingMeters: float  # noqa: N815
    colSpacingMeters: float  # noqa: N815

    def board(self) -> Chessboard:
        """Counted in inner corners, as ours; its squares must be square."""
        if abs(self.rowSpacingMeters - self.colSpacingMeters) > 1e-9:
            raise InputError(
                f"Kalibr's target: its squares are {self.colSpacingMeters:g} x"
                f" {self.rowSpacingMeters:g} m; only square ones are known"
            )
        return Chessboard(
            type="chessboard",
            rows=self.targetRows,
            cols=self.targetCols,
            square_m=self.rowSpacingMeters,
        )


_KINDS: dict[str, type[_AprilGrid] | type[_Checkerboard]] = {
    "aprilgrid": _AprilGrid,
    "checkerboard": _Checkerboard,
}


def kalibr_board(path: Path, data: CommentedMap) -> AprilGrid | Chessboard:
    """The board of a target file's `data`; raises `InputError` with line and key of a fault."""
    kind = data.get("target_type")
    if kind is None:
        raise InputError(f"{path}: has neither `board`, as a cell file, nor Kalibr's `target_type`")
    if kind not in _KINDS:
        raise InputError(f"{path}: target_type is {kind!r}; known are {', '.join(_KINDS)}")
    try:
        return parse_model(path, data, _KINDS[kind]).board()
    except ValidationError as fault:
        raise InputError(f"{path}: {fault.errors()[0]['msg']}") from None


def kalibr_target(board: AprilGrid) -> str:
    """The board as Kalibr reads it."""
    spacing = board.gap_m / board.tag_m
    return (
        "target_type: 'aprilgrid'\n"
        f"tagCols: {board.tags_x}\n"
        f"tagRows: {board.tags_y}\n"
        f"tagSize: {board.tag_m!r}  # m, edge to edge of the black border\n"
        f"tagSpacing: {spacing!r}  # gap between tags / tagSize\n"
    )
