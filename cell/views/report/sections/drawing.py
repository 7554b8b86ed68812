"""A drawing with its caption, or the reason why it is not there."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from cell.views.report import html
from cell.views.report.figures.canvas import inline_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def drawing(draw: Callable[[], Figure | None], caption: str, otherwise: str) -> str:
    """The figure as HTML; where `draw` gives None, the words of `otherwise`."""
    svg = inline_svg(draw, caption)
    return html.missing(otherwise) if svg is None else html.figure(svg, caption)
