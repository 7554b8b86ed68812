"""The camera position's error of each solution against the robot: the paper's Figs. 4 and 15."""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray
from cell.views.numbers import solution_name
from cell.views.report.data import ReportData, in_order
from cell.views.report.figures.canvas import style
from cell.views.report.geometry import position_error_m, reference
from cell.views.report.plot import Figure, legend_below, panels

_ZOOM = 5.0


def errors_mm(data: ReportData) -> dict[str, FloatArray]:
    """Per solution (N, 3) camera position error in the true camera's axes, millimetres."""
    out = {}
    for name in in_order(data.poses):
        poses = data.poses[name]
        true, _ = reference(data, poses)
        if true is not None:
            out[name] = position_error_m(poses.board_from_camera, true) * 1e3
    return out


def draw(data: ReportData) -> Figure | None:
    """x, y, z error per frame; a second row enlarges what the first one flattens."""
    errors = errors_mm(data)
    if not errors:
        return None
    small = _small(errors)
    rows = 2 if small and len(small) < len(errors) else 1
    figure, axes = panels(9.2, 0.6 + 2.3 * rows, columns=3, rows=rows, sharex=True)
    for axis in range(3):
        for row, names in enumerate([list(errors), small][:rows]):
            ax = axes[3 * row + axis]
            for name in names:
                look = {**style(name), "linewidth": 0.9}
                ax.plot(data.views.frame, errors[name][:, axis], label=solution_name(name),
                        fillstyle="none", **look)  # fmt: skip
            ax.axhline(0, color="#5b616b", linewidth=0.8)
            ax.set(title="xyz"[axis] + (" — enlarged" if row else ""))
        axes[3 * (rows - 1) + axis].set(xlabel="frame")
    for row in range(rows):
        axes[3 * row].set(ylabel="error (mm)")
    legend_below(figure, axes)
    return figure


def _small(errors: dict[str, FloatArray]) -> list[str]:
    """The solutions too good to be seen on the scale of the worst one."""
    size = {name: _rms(error) for name, error in errors.items()}
    return [name for name, rms in size.items() if rms * _ZOOM < max(size.values())]


def _rms(error: FloatArray) -> float:
    finite = error[np.isfinite(error)]
    return float(np.sqrt((finite**2).mean())) if len(finite) else np.inf
