"""`detections.csv`: the corners found in every frame, by (row, col)."""

from __future__ import annotations

import csv
import logging
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

from calib.views import Board, FloatArray
from cell.errors import InputError
from cell.storage.atomic import atomic_file
from cell.storage.incoming import read_text
from cell.storage.incoming.limits import (
    CORNERS,
    FRAME_NUMBER,
    LINE_CHARACTERS,
    LOG_BYTES,
    PIXELS,
)

FILE_NAME = "detections.csv"
COLUMNS = ("frame", "row", "col", "u_px", "v_px")
EXTRA_COLUMNS = ("sigma_px", "blur_px")

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Corners:
    """Detected corners by frame number.

    Attributes
    ----------
    px:
        frame -> (M, 2) pixels, row by row; NaN where a corner was not found.
    sigma_px:
        frame -> (M,) the detector's one-sigma per axis, where it gave one.
    blur_px:
        frame -> edge blur (Gaussian sigma), where it was measured.
    rejected:
        frame -> why the frame's picture gave no corners.
    """

    px: Mapping[int, FloatArray]
    sigma_px: Mapping[int, FloatArray] = field(default_factory=dict)
    blur_px: Mapping[int, float] = field(default_factory=dict)
    rejected: Mapping[int, str] = field(default_factory=dict)

    def without(self, rejected: Mapping[int, str]) -> Corners:
        """The corners less those of rejected frames, whose reasons are kept."""
        return Corners(
            px=_less(self.px, rejected),
            sigma_px=_less(self.sigma_px, rejected),
            blur_px=_less(self.blur_px, rejected),
            rejected={**self.rejected, **rejected},
        )


Value = TypeVar("Value")


def _less(values: Mapping[int, Value], frames: Mapping[int, str]) -> dict[int, Value]:
    return {frame: value for frame, value in values.items() if frame not in frames}


def check_corners(frames: int, corners: int, where: str) -> None:
    """Refuse a recording that no memory holds; raises `InputError`."""
    if frames * corners > CORNERS:
        raise InputError(
            f"{where}: {frames} frames of a board with {corners} corners are more than {CORNERS}"
            " corners; split the recording, or check rows and cols of the board"
        )


def read_corners(path: Path, board: Board) -> Corners:
    """Read a `detections.csv`; columns `sigma_px` and `blur_px` may stand there too.

    A last row without its newline may be cut in the middle of a number: it is dropped with a
    warning.

    Raises
    ------
    InputError
        A column is missing, a value is no number, or a corner lies outside the board.
    """
    px: dict[int, FloatArray] = {}
    sigma_px: dict[int, FloatArray] = {}
    blur_px: dict[int, float] = {}
    for line, row in _rows(path):
        frame, index, values = _values(path, line, row, board)
        if frame not in px:
            check_corners(len(px) + 1, board.corner_count, f"{path}:{line}")
        corners = px.setdefault(frame, np.full((board.corner_count, 2), np.nan))
        if np.isfinite(corners[index]).any():
            raise InputError(f"{path}:{line}: frame {frame} has this corner twice")
        if abs(values["u_px"]) < PIXELS and abs(values["v_px"]) < PIXELS:
            corners[index] = values["u_px"], values["v_px"]
        if "sigma_px" in values:
            missing = np.full(board.corner_count, np.nan)
            sigma_px.setdefault(frame, missing)[index] = values["sigma_px"]
        if "blur_px" in values:
            blur_px[frame] = values["blur_px"]
    return Corners(px, sigma_px, blur_px)


def write_corners(path: Path, corners: Corners, board: Board) -> None:
    """Write a `detections.csv`, whole or not at all (an older one of that name is replaced)."""
    with atomic_file(path, newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS + EXTRA_COLUMNS if corners.sigma_px else COLUMNS)
        for frame in sorted(corners.px):
            writer.writerows(_frame_rows(corners, frame, board))


def _frame_rows(corners: Corners, frame: int, board: Board) -> Iterator[list[object]]:
    extra = bool(corners.sigma_px)
    sigma_px = corners.sigma_px.get(frame, np.full(board.corner_count, np.nan))
    blur_px = corners.blur_px.get(frame, math.nan)
    for index, (u_px, v_px) in enumerate(corners.px[frame]):
        if math.isfinite(u_px) and math.isfinite(v_px):
            row: list[object] = [frame, *divmod(index, board.cols), f"{u_px:.6f}", f"{v_px:.6f}"]
            yield row + ([f"{sigma_px[index]:.6f}", f"{blur_px:.4f}"] if extra else [])


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    text = read_text(path, LOG_BYTES)
    lines = text.splitlines(keepends=True)
    if lines and not lines[-1].endswith("\n"):
        log.warning("%s:%d: the last row is cut off; it is left out", path, len(lines))
        lines.pop()
    reader = csv.DictReader(_short(path, lines))
    absent = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if absent:
        raise InputError(f"{path}:1: has no column {', '.join(absent)} (need {', '.join(COLUMNS)})")
    for row in reader:
        yield reader.line_num, row


def _short(path: Path, lines: list[str]) -> Iterator[str]:
    for number, line in enumerate(lines, 1):
        if len(line) > LINE_CHARACTERS or "\0" in line:
            raise InputError(f"{path}:{number}: is no row of corners ({len(line)} characters)")
        yield line


def _values(
    path: Path, line: int, row: Mapping[str, str], board: Board
) -> tuple[int, int, dict[str, float]]:
    try:
        frame, at_row, at_col = (int(row[name]) for name in COLUMNS[:3])
        values = {name: float(row[name]) for name in COLUMNS[3:]}
        values |= {name: float(row[name]) for name in EXTRA_COLUMNS if row.get(name)}
    except (TypeError, ValueError) as broken:
        raise InputError(f"{path}:{line}: is no corner: {broken}") from None
    if not 0 <= frame <= FRAME_NUMBER:
        raise InputError(f"{path}:{line}: {frame} is no frame number")
    if not (0 <= at_row < board.rows and 0 <= at_col < board.cols):
        raise InputError(
            f"{path}:{line}: corner ({at_row}, {at_col}) lies outside the board of"
            f" {board.rows} rows and {board.cols} cols in recording.yaml"
        )
    return frame, at_row * board.cols + at_col, values
