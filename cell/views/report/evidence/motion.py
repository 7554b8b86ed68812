"""Evidence for what depends on speed: clocks and shutters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cell.views.report.data import ReportData
from cell.views.report.evidence.scatter import before_after, shifts_m, size_mm
from cell.views.report.plot import Figure, legend_below, panels


def error_against_speed(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """Length of the position error against the joints' speed at the exposure."""
    shifts = shifts_m(data, effect)
    speed = np.linalg.norm(data.views.joint_velocity_rad_s, axis=1)
    if shifts is None or not np.isfinite(speed).any():
        return None
    figure, (ax,) = panels(9.2, 2.9)
    before_after(ax, np.degrees(speed), shifts, size_mm)
    ax.set(xlabel="joint speed, all joints together (°/s)", ylabel="position error (mm)")
    legend_below(figure, [ax])
    return figure
