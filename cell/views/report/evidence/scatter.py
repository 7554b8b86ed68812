"""Before and after, the same look in every piece of evidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLUE, VERMILLION
from cell.views.report.plot import Axes

Pair = tuple[FloatArray, FloatArray | None]
"""Errors without an effect, and with it where that was measured."""

WITHOUT, WITH = "without it", "with what was found"


def before_after(
    ax: Axes,
    x: FloatArray,
    errors: Pair,
    read: Callable[[FloatArray], FloatArray],
    trend: bool = True,
) -> None:
    """What `read` takes from the errors of each frame, without (triangles) and with the effect."""
    for error, colour, marker, label in (
        (errors[0], VERMILLION, "^", WITHOUT),
        (errors[1], BLUE, ".", WITH),
    ):
        if error is not None:
            _points(ax, x, read(error), colour, marker, label, trend)
    ax.axhline(0, color="#5b616b", linewidth=0.8, zorder=1)


def size_mm(shift_m: FloatArray) -> FloatArray:
    """(N,) lengths of position errors, millimetres."""
    return np.asarray(np.linalg.norm(shift_m, axis=1) * 1e3)


def component(error: FloatArray, axis: int) -> FloatArray:
    """(N,) one component of position or orientation errors, in mm or mrad."""
    return np.asarray(error[:, axis] * 1e3)


def shifts_m(data: ReportData, effect: Mapping[str, Any]) -> Pair | None:
    """Position errors without and with the effect, or None where they were not measured."""
    found = data.evidence
    if found is None:
        return None
    before = found.shift_without_m.get(effect["name"], found.shift_before_m)
    return None if before is None else (before, found.shift_after_m)


def turns_rad(data: ReportData, effect: Mapping[str, Any]) -> Pair | None:
    """Orientation errors without and with the effect, or None where they were not measured."""
    found = data.evidence
    if found is None:
        return None
    before = found.turn_without_rad.get(effect["name"], found.turn_before_rad)
    return None if before is None else (before, found.turn_after_rad)


def _points(
    ax: Axes, x: FloatArray, y: FloatArray, colour: str, marker: str, label: str, trend: bool
) -> None:
    ax.plot(x, y, linestyle="", marker=marker, color=colour, fillstyle="none", label=label)
    if trend:
        middle = running_median(x, y)
        ax.plot(*middle, color=colour, linewidth=1.2)


def running_median(x: FloatArray, y: FloatArray, parts: int = 6) -> tuple[FloatArray, FloatArray]:
    """Medians of x and y over `parts` groups of neighbouring x, to guide the eye."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) < 3 * parts:
        return np.zeros(0), np.zeros(0)
    groups = np.array_split(np.argsort(x, kind="stable"), parts)
    return (
        np.array([np.median(x[g]) for g in groups]),
        np.array([np.median(y[g]) for g in groups]),
    )
