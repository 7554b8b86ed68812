"""A drawing with its caption, or the reason why it is not there."""

from __future__ import annotations

from collections.abc import Callable

from cell.views.report import html
from cell.views.report.plot import Figure


def drawing(draw: Callable[[], Figure | None], caption: str, otherwise: str) -> str:
    """The figure as HTML; where `draw` gives None, the words of `otherwise`."""
    figure = draw()
    return html.missing(otherwise) if figure is None else html.figure(figure.svg(caption), caption)
