"""Camera positions, true and computed, from above and from the side: the paper's Fig. 3."""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray
from cell.views.numbers import solution_name
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLACK, GREY, style
from cell.views.report.geometry import reference
from cell.views.report.plot import Axes, Figure, legend_below, panels

_NUMBERED = 20


def draw(data: ReportData) -> Figure | None:
    """Two views of the board frame, or None without a solution's camera poses."""
    shown = [name for name in ("zhang_mle", data.best_of(data.poses)) if name in data.poses]
    if not shown:
        return None
    figure, axes = panels(9.2, 4.2, columns=2)
    for ax, axis, title in zip(axes, (0, 1), ("from above", "from the side"), strict=True):
        _board(ax, data, axis)
        for name in dict.fromkeys(shown):
            _solution(ax, data, str(name), axis)
        ax.set(aspect="limits", down=True, title=title, ylabel=f"{'xy'[axis]} along the board (mm)")
        ax.set(xlabel="distance from the board (mm)")
    legend_below(figure, axes, columns=4)
    return figure


def _board(ax: Axes, data: ReportData, axis: int) -> None:
    edge = data.views.board.corners_m[:, axis] * 1e3
    ends = [edge.min(), edge.max()]
    ax.plot([0, 0], ends, color=BLACK, linewidth=5, label="board")


def _solution(ax: Axes, data: ReportData, name: str, axis: int) -> None:
    poses = data.poses[name]
    at = _plane_mm(poses.board_from_camera, axis)
    look = {**style(name), "linestyle": ""}
    label = solution_name(name)
    ax.plot(*at.T, label=label, fillstyle="none", zorder=3, **look)
    true, whose = reference(data, poses)
    if true is None:
        return
    where = _plane_mm(true, axis)
    pairs = np.stack([where, at, np.full(at.shape, np.nan)], axis=1)
    ax.plot(*pairs.reshape(-1, 2).T, color=look["color"], linewidth=0.7, alpha=0.6)
    ax.plot(
        *where.T, marker="*", linestyle="", color=BLACK, markersize=6, label=f"by {whose}", zorder=1
    )
    if len(at) <= _NUMBERED:
        for frame, place in zip(data.views.frame, where, strict=True):
            ax.annotate(str(frame), *place, right=4, up=2, size=7, color=GREY)


def _plane_mm(board_from_camera: FloatArray, axis: int) -> FloatArray:
    """(N, 2) distance from the board's plane, and place along one of its axes, millimetres."""
    at = board_from_camera
    return np.stack([-at[:, 2, 3], at[:, axis, 3]], axis=1) * 1e3
