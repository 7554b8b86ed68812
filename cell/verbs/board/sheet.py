"""The sheet to print: the board at scale with its quiet zone, a ruler and its description."""

from __future__ import annotations

from pathlib import Path

from calib.views import Board
from cell.errors import InputError
from cell.storage.atomic import atomic_file
from cell.storage.files.board_file import board_file
from cell.verbs.board.pattern import dark, size_mm
from cell.verbs.board.vector_page import Line, VectorPage

SUFFIXES = (".pdf", ".svg")
PAPERS_MM = {
    "a4": (210.0, 297.0),
    "a3": (297.0, 420.0),
    "a2": (420.0, 594.0),
    "a1": (594.0, 841.0),
    "a0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
    "tabloid": (279.4, 431.8),
}
_RULER_MM = 100.0
_FOOT_MM = 26.0
"""Ruler and words below the quiet zone."""

_MARGIN_MM = 6.0
"""Printers leave so much of the paper white."""

_TEXT_WIDTH_MM = 150.0
"""The longest line of the foot."""


def draw_board(board: Board, path: Path, paper: str | None = None) -> tuple[float, float]:
    """Draw the board; returns width and height of the page, millimetres.

    Parameters
    ----------
    path:
        A `.pdf` or `.svg`.
    paper:
        One of `PAPERS_MM`, either way round; a page just large enough where None.

    Raises
    ------
    InputError
        It does not fit the paper, is no such file, or cannot be written.
    """
    suffix = path.suffix.lower()
    if board.kind == "aprilgrid":
        raise InputError(f"-o {path}: an AprilGrid is drawn by Kalibr: {kalibr_command(board)}")
    if suffix not in SUFFIXES:
        raise InputError(f"-o {path}: must end with {' or '.join(SUFFIXES)}")
    page = sheet(board, paper)
    with atomic_file(path) as file:
        file.write(page.pdf() if suffix == ".pdf" else page.svg())
    return page.width_mm, page.height_mm


def kalibr_command(board: Board) -> str:
    """What draws an AprilGrid."""
    spacing = float(board.gap_m or 0.0) / board.square_m
    return (
        "kalibr_create_target_pdf --type apriltag"
        f" --nx {board.cols // 2} --ny {board.rows // 2} --tsize {board.square_m:g}"
        f" --tspace {spacing:g}"
    )


def sheet(board: Board, paper: str | None = None) -> VectorPage:
    """The page with the board in its middle, a square's width of white around it."""
    wide, high = size_mm(board)
    quiet = 1e3 * board.square_m
    page = _page((wide + 2 * quiet, high + 2 * quiet + _FOOT_MM), paper)
    left, top = (page[0] - wide) / 2, (page[1] - _FOOT_MM - high) / 2
    foot = (max(min(left, page[0] - _TEXT_WIDTH_MM - _MARGIN_MM), _MARGIN_MM), page[1] - _FOOT_MM)
    lines = (
        "ruler: 100 mm. Print at 100 %, not fitted to the page.",
        description(board),
        "The corner nearest to the top left of the pattern is row 0, col 0.",
    )
    return VectorPage(
        title=f"calibration board, {description(board)}",
        width_mm=page[0],
        height_mm=page[1],
        rectangles=tuple((left + x, top + y, w, h) for x, y, w, h in dark(board)),
        lines=_ruler(foot[0], foot[1] + 8.0),
        texts=tuple((foot[0], foot[1] + 12.5 + 4.0 * k, text) for k, text in enumerate(lines)),
    )


def description(board: Board) -> str:
    """The board as a cell file has it."""
    fields = board_file(board).model_dump()
    return "board: {" + ", ".join(f"{key}: {value}" for key, value in fields.items()) + "}"


def how_to_check(board: Board, path: Path, page_mm: tuple[float, float]) -> str:
    """The description for the cell file, and how to print, check and mount the sheet."""
    wide, high = size_mm(board)
    cols, rows = board.cols + 1, board.rows + 1
    return (
        f"{path}: {page_mm[0]:.1f} x {page_mm[1]:.1f} mm, pattern {wide:.1f} x {high:.1f} mm\n"
        f"for the cell file:\n  {description(board)}\n"
        "print it at 100 %, not fitted to the page, and measure the print:\n"
        f"  ruler 100.0 mm; {cols} squares along a row {wide:.1f} mm, {rows} along a column"
        f" {high:.1f} mm\n"
        f"  another length: square_m is that of the {cols} squares divided by {cols}; rows and"
        " columns that differ by more than 0.1 %: another printer\n"
        "glue it on a stiff flat plate without bubbles; keep the white edge free, it is the quiet"
        " zone"
    )


def _page(least: tuple[float, float], paper: str | None) -> tuple[float, float]:
    if paper is None:
        return max(least[0], _TEXT_WIDTH_MM + 2 * _MARGIN_MM), least[1]
    if paper.lower() not in PAPERS_MM:
        raise InputError(f"--paper {paper}: is not known; known are {', '.join(PAPERS_MM)}")
    short, long = PAPERS_MM[paper.lower()]
    for page in ((short, long), (long, short)):
        if all(have >= need for have, need in zip(page, least, strict=True)):
            return page
    raise InputError(
        f"--paper {paper}: is too small: the board with its quiet zone and ruler needs"
        f" {least[0]:.0f} x {least[1]:.0f} mm. Take larger paper, fewer or smaller squares"
    )


def _ruler(left: float, line: float) -> tuple[Line, ...]:
    """A line of 100 mm with a tick every 10 mm."""
    at = [left + 10.0 * k for k in range(11)]
    ticks = ((x, line - (4.0 if k % 5 == 0 else 2.5), x, line) for k, x in enumerate(at))
    return ((left, line, left + _RULER_MM, line), *ticks)
