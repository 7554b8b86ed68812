"""Evidence for a mount or lens that gives way to gravity."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.views.report.data import ReportData
from cell.views.report.evidence.scatter import before_after, component, shifts_m, turns_rad
from cell.views.report.plot import Figure, legend_below, panels


def error_against_gravity(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """The turns (or else shifts) that follow gravity most, against the axis they follow."""
    gravity = None if data.evidence is None else data.evidence.gravity_in_camera
    errors, word, unit = turns_rad(data, effect), "turn about", "mrad"
    if errors is None:
        errors, word, unit = shifts_m(data, effect), "shift along", "mm"
    if gravity is None or errors is None:
        return None
    figure, axes = panels(9.2, 2.9, columns=3)
    for ax, (axis, along) in zip(axes, _most_alike(errors[0], gravity), strict=False):
        before_after(ax, gravity[:, along], errors, partial(component, axis=axis))
        ax.set(xlabel=f"gravity along the camera's {'xyz'[along]} (g)")
        ax.set(ylabel=f"{word} {'xyz'[axis]} ({unit})")
    legend_below(figure, axes)
    return figure


def _most_alike(error: FloatArray, gravity: FloatArray) -> list[tuple[int, int]]:
    """(error component, gravity component) pairs, the most correlated first."""
    known = np.isfinite(error).all(axis=1) & np.isfinite(gravity).all(axis=1)
    both = np.concatenate([error[known], gravity[known]], axis=1)
    alike = np.abs(np.nan_to_num(np.cov(both, rowvar=False)[:3, 3:]))
    order = np.argsort(-alike, axis=None)
    return [(int(k // 3), int(k % 3)) for k in order]
