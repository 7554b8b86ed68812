"""Evidence for what changes while the run goes on: drifts, slips, mixed-up frames."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from calib.views import FloatArray, Views
from cell.views.report.data import ReportData
from cell.views.report.evidence.scatter import before_after, component, shifts_m, size_mm
from cell.views.report.plot import Figure, legend_below, panels

_NAMED = 6


def drift(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """Position error along each camera axis against time, or temperature where time is missing."""
    shifts, clock = shifts_m(data, effect), _clock(data.views)
    if shifts is None or clock is None:
        return None
    x, label = clock
    figure, axes = panels(9.2, 2.9, columns=3, sharey=True)
    for axis, ax in enumerate(axes):
        before_after(ax, x, shifts, partial(component, axis=axis))
        ax.set(title="xyz"[axis], xlabel=label)
    axes[0].set(ylabel="error (mm)")
    legend_below(figure, axes)
    return figure


def by_frame(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """Length of the position error frame by frame, the worst frames named."""
    shifts = shifts_m(data, effect)
    if shifts is None:
        return None
    before = size_mm(shifts[0])
    figure, (ax,) = panels(9.2, 2.9)
    before_after(ax, data.views.frame.astype(float), shifts, size_mm, trend=False)
    worst = np.argsort(-np.nan_to_num(before))[:_NAMED]
    for index in worst[before[worst] > 5 * np.nanmedian(before)]:
        frame = int(data.views.frame[index])
        ax.annotate(str(frame), frame, float(before[index]), right=4, up=2)
    ax.set(xlabel="frame", ylabel="position error (mm)")
    legend_below(figure, [ax])
    return figure


def _clock(views: Views) -> tuple[FloatArray, str] | None:
    if np.isfinite(views.t_s).any():
        return (views.t_s - np.nanmin(views.t_s)) / 60.0, "time (min)"
    if np.isfinite(views.temperature_c).any():
        return views.temperature_c, "temperature (°C)"
    return None
