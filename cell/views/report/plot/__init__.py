"""Drawings as SVG text: axes, what stands in them, and how they are laid out.

Matplotlib lays text out by rendering it and needs 0.7 CPU s and 26 MB for a drawing like the
report's; seven of them took longer than the calibration they show. What is here writes the same
few kinds of marks straight into SVG, in a few milliseconds.
"""

from __future__ import annotations

from cell.views.report.plot.axes import Axes
from cell.views.report.plot.figure import Figure, legend_below, panels

__all__ = ["Axes", "Figure", "legend_below", "panels"]
