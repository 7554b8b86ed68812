"""Text on a drawing: it stays text, and how wide it will be is estimated."""

from __future__ import annotations

from html import escape
from typing import Literal

SIZE = 9.8
SOFT = "#5b616b"
_WIDTH = 0.56
"""Mean width of a letter of DejaVu Sans as a share of its size; somewhat wide for running text."""


def width_of(text: str, size: float = SIZE) -> float:
    """About how wide words are, points."""
    return _WIDTH * size * len(text)


def text_at(
    x: float,
    y: float,
    text: str,
    *,
    size: float = SIZE,
    anchor: Literal["start", "middle", "end"] = "start",
    color: str = "#000000",
    bold: bool = False,
    turned: bool = False,
) -> str:
    """Words whose baseline's start, middle or end is at (x, y); `turned` reads upwards."""
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    weight = ' font-weight="bold"' if bold else ""
    fill = "" if color == "#000000" else f' fill="{color}"'
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" text-anchor="{anchor}"'
        f"{weight}{fill}{turn}>{escape(text)}</text>"
    )
