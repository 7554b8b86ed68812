"""Evidence for a mount or lens that gives way to gravity."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cell.report.data import ReportData
from cell.report.evidence.scatter import before_after, component, shifts_m, turns_rad
from cell.report.figures.canvas import legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def error_against_gravity(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """The turn (or else shift) that varies most, against gravity along the camera's axes."""
    gravity = None if data.evidence is None else data.evidence.gravity_in_camera
    errors, word, unit = turns_rad(data, effect), "turn about", "mrad"
    if errors is None:
        errors, word, unit = shifts_m(data, effect), "shift along", "mm"
    if gravity is None or errors is None:
        return None
    worst = int(np.argmax(np.nanstd(errors[0], axis=0)))
    figure, axes = panels(9.2, 2.9, columns=3, sharey=True)
    for axis, ax in enumerate(axes):
        before_after(ax, gravity[:, axis], errors, partial(component, axis=worst))
        ax.set(xlabel=f"gravity along the camera's {'xyz'[axis]} (g)")
    axes[0].set_ylabel(f"{word} {'xyz'[worst]} ({unit})")
    legend_below(figure, axes)
    return figure
