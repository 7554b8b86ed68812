"""How every drawing looks, and how it becomes inline SVG."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, distinct with every kind of colour vision; line style and marker say
# the same thing again, for a print without colour.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#8a8f98",
)  # fmt: skip
STYLES: dict[str, dict[str, Any]] = {
    "joint_ml": {"color": BLUE, "marker": "o", "linestyle": "-"},
    "fixed_alpha_mle": {"color": GREEN, "marker": "s", "linestyle": "-"},
    "fixed_alpha_algebraic": {"color": SKY, "marker": "D", "linestyle": "--"},
    "zhang_mle": {"color": VERMILLION, "marker": "^", "linestyle": "-"},
    "zhang_algebraic": {"color": ORANGE, "marker": "v", "linestyle": "--"},
}
_OTHER = {"color": PURPLE, "marker": "x", "linestyle": ":"}
_RC: Any = {  # Any: the stubs type every key apart
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 9.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5b616b",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "grid.color": "#e3e6ea",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.markersize": 4.0,
    "lines.linewidth": 1.4,
    "image.interpolation": "nearest",
}


def style(solution: str) -> dict[str, Any]:
    """Colour, marker and line of a solution, the same in every drawing."""
    return STYLES.get(solution, _OTHER)


def panels(
    width_in: float, height_in: float, columns: int = 1, rows: int = 1, **options: Any
) -> tuple[Figure, list[Axes]]:
    """A figure and its axes, row by row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, [ax for row in axes for ax in row]


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3) -> None:
    """One legend for all axes, under the drawing, each entry once."""
    entries: dict[str, Any] = {}
    for ax in axes:
        entries.update(dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True)))
    if entries:
        figure.legend(
            list(entries.values()), list(entries), loc="outside lower center", ncols=columns
        )


def inline_svg(draw: Callable[[], Figure | None], label: str) -> str | None:
    """The drawing as an SVG element that may stand in HTML, or None where `draw` gives None.

    Text stays text, so that it can be searched and read aloud; `label` is what a screen reader
    says.
    """
    import matplotlib

    # each drawing gets its own salt: ids of clip paths must differ within one page
    salt = hashlib.sha256(label.encode()).hexdigest()[:12]
    with matplotlib.rc_context(_RC | {"svg.hashsalt": salt}):
        figure = draw()
        if figure is None:
            return None
        stream = io.StringIO()
        figure.savefig(stream, format="svg", transparent=True, dpi=110, metadata={"Date": None})
    return _embeddable(stream.getvalue(), label)


def _embeddable(svg: str, label: str) -> str:
    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r"<!--.*?-->", "", body, flags=re.DOTALL)
    body = re.sub(r'<g id="[^"]*"', "<g", body)
    body = re.sub(r' (?:width|height)="[\d.]+pt"', "", body, count=2)
    body = re.sub(r"\n\s*", "\n", body)
    return body.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1)
