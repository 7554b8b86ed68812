"""Camera positions, true and computed, from above and from the side: the paper's Fig. 3."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cell.report.data import ReportData, SolutionPoses
from cell.report.figures.canvas import BLACK, GREY, legend_below, panels, style
from cell.report.geometry import reference
from cell.report.numbers import solution_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NUMBERED = 20


def draw(data: ReportData) -> Figure | None:
    """Two views of the board frame, or None without a solution's camera poses."""
    shown = [name for name in ("zhang_mle", data.best_of(data.poses)) if name in data.poses]
    if not shown:
        return None
    figure, axes = panels(9.2, 4.4, columns=2, sharey=True)
    for ax, across, title in zip(axes, (0, 1), ("from above", "from the side"), strict=True):
        _board(ax, data, across)
        for name in dict.fromkeys(shown):
            _solution(ax, data, str(name), across)
        ax.set(title=title, xlabel=f"{'xy'[across]} along the board (mm)")
    axes[0].set_ylabel("distance from the board (mm)")
    legend_below(figure, axes, columns=4)
    return figure


def _board(ax: Axes, data: ReportData, across: int) -> None:
    edge = data.views.board.corners_m[:, across] * 1e3
    ax.plot([edge.min(), edge.max()], [0, 0], color=BLACK, linewidth=5, solid_capstyle="butt")
    ax.annotate("board", (edge.max(), 0), xytext=(6, -3), textcoords="offset points", fontsize=8)


def _solution(ax: Axes, data: ReportData, name: str, across: int) -> None:
    poses = data.poses[name]
    at = _plane(poses, across)
    true, whose = reference(data, poses)
    if true is not None:
        where = np.stack([true[:, across, 3], -true[:, 2, 3]], axis=1) * 1e3
        ax.plot(*np.stack([where, at], axis=1).T, color=style(name)["color"], linewidth=0.7,
                alpha=0.6)  # fmt: skip
        ax.plot(*where.T, "*", color=BLACK, markersize=6, label=f"by {whose}", zorder=1)
    look = {**style(name), "linestyle": ""}
    ax.plot(*at.T, label=solution_name(name), fillstyle="none", zorder=3, **look)
    if len(at) <= _NUMBERED and true is not None:
        for frame, (x, z) in zip(data.views.frame, where, strict=True):
            ax.annotate(str(frame), (x, z), xytext=(4, 2), textcoords="offset points",
                        fontsize=7, color=GREY)  # fmt: skip


def _plane(poses: SolutionPoses, across: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    at = poses.board_from_camera
    return np.stack([at[:, across, 3], -at[:, 2, 3]], axis=1) * 1e3
