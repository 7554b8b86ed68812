"""The sheet: the board at scale with its quiet zone, a ruler, and how to check the print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from calib.views import Board
from cell.errors import InputError
from cell.storage.files.board_file import board_file
from cell.verbs.board.pattern import dark, size_mm

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
_MM_PER_INCH = 25.4
_RULER_MM = 100.0
_FOOT_MM = 26.0
"""Ruler and words below the quiet zone."""

_MARGIN_MM = 6.0
"""Printers leave so much of the paper white."""


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
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"-o {path}: must end with {' or '.join(SUFFIXES)}")
    wide, high = size_mm(board)
    quiet = 1e3 * board.square_m
    least = (wide + 2 * quiet, high + 2 * quiet + _FOOT_MM)
    page = _page(least, paper)
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    figure = Figure(figsize=(page[0] / _MM_PER_INCH, page[1] / _MM_PER_INCH))
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set(xlim=(0, page[0]), ylim=(page[1], 0))
    ax.set_axis_off()
    left = (page[0] - wide) / 2
    top = (page[1] - _FOOT_MM - high) / 2
    for x, y, width, height in dark(board):
        corner = (left + x, top + y)
        ax.add_patch(
            Rectangle(corner, width, height, color="black", linewidth=0, antialiased=False)
        )
    _foot(ax, board, (max(left, _MARGIN_MM), page[1] - _FOOT_MM))
    try:
        figure.savefig(path, metadata={"Title": f"calibration board {_name(board)}"})
    except OSError as fault:
        raise InputError(f"{path}: cannot be written: {fault.strerror}") from None
    return page


def _page(least: tuple[float, float], paper: str | None) -> tuple[float, float]:
    if paper is None:
        return max(least[0], _RULER_MM + 2 * _MARGIN_MM), least[1]
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


def _foot(ax: Axes, board: Board, at: tuple[float, float]) -> None:
    """A ruler with a tick every 10 mm, and the board in words."""
    left, top = at
    line = top + 8.0
    ax.plot([left, left + _RULER_MM], [line, line], color="black", linewidth=0.5)
    for k in range(11):
        x = left + 10.0 * k
        ax.plot([x, x], [line - (4.0 if k % 5 == 0 else 2.5), line], color="black", linewidth=0.5)
    ax.text(left, line + 4.5, "ruler: 100 mm. Print at 100 %, not fitted to the page.", fontsize=7)
    ax.text(left, line + 9.0, _name(board), fontsize=7)
    ax.text(left, line + 13.5, "The top left corner of the pattern is row 0, col 0.", fontsize=7)


def _name(board: Board) -> str:
    said = board_file(board).model_dump()
    return "board: {" + ", ".join(f"{key}: {value}" for key, value in said.items()) + "}"


def words_about(board: Board, path: Path, page_mm: tuple[float, float]) -> str:
    """The description for the cell file, and how to print, check and mount it."""
    wide, high = size_mm(board)
    squares = board.cols + 1
    return (
        f"{path}: {page_mm[0]:.1f} x {page_mm[1]:.1f} mm, pattern {wide:.1f} x {high:.1f} mm\n"
        f"for the cell file:\n  {_name(board)}\n"
        "print it at 100 % (no fitting, no scaling) on matt paper or have it printed on a plate;"
        " then measure:\n"
        f"  the ruler must be 100.0 mm; {squares} squares from edge to edge {wide:.1f} mm along the"
        f" rows, {board.rows + 1} squares {high:.1f} mm along the columns\n"
        f"  where it is not: write square_m as the measured length over {squares} into the cell"
        " file; where rows and columns differ by more than 0.1 %, print on another printer\n"
        "glue it flat on glass, aluminium honeycomb or a stiff plate, without bubbles, and leave"
        " the white edge free: it is the quiet zone"
    )
