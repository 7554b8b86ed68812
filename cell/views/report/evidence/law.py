"""Evidence for a law without a name: its shape over what it follows, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLUE, VERMILLION
from cell.views.report.plot import Figure, panels

LOOK_FOR = (
    "Each point is what one frame alone says; the line is the law, the thin lines beside it are two"
    " sigma of it. Points that leave the line together mean a form that is not yet right."
)


def shape(data: ReportData, unexplained: Mapping[str, Any]) -> Figure | None:
    """The law over its covariate with every frame's own estimate; None where it has no curve."""
    shapes = () if data.evidence is None else data.evidence.laws
    place = (unexplained.get("site"), unexplained.get("covariate"))
    found = next((s for s in shapes if (s.site, s.covariate) == place), None)
    if found is None:
        return None
    figure, (ax,) = panels(7.0, 3.2, columns=1)
    ax.errorbar(
        found.at, found.by_frame, found.by_frame_sigma, ecolor="#b9c0c9", marker=".",
        color=VERMILLION, label="by each frame alone",
    )  # fmt: skip
    ax.plot(found.grid, found.value, color=BLUE, linewidth=1.6, label="the law")
    for side in (-2.0, 2.0):
        ax.plot(found.grid, found.value + side * found.sigma, color=BLUE, linewidth=0.7)
    ax.set(xlabel=found.axis.replace("_", " "), ylabel=found.component.replace("_", " "))
    return figure
