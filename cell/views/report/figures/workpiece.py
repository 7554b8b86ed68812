"""Error at the work piece against distance: the drawing of the first screen."""

from __future__ import annotations

from cell.views.answer_text import SIGMAS
from cell.views.numbers import millimetres, solution_name
from cell.views.report.answer_values import answer_of, shared_by_distance
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import style
from cell.views.report.plot import Axes, Figure, legend_below, panels
from cell.views.report.workpiece_error import by_distance, of_solution

_SHOWN = ("joint_ml", "fixed_alpha_mle", "zhang_mle")


def draw(data: ReportData) -> Figure | None:
    """Every frame's error at the work piece, on a logarithmic scale, with the RMS by distance."""
    found = {name: of_solution(data, name) for name in _SHOWN}
    drawn = {name: error for name, error in found.items() if error is not None}
    if not drawn:
        return None
    figure, (ax,) = panels(5.3, 3.4)
    for name, error in drawn.items():
        look = style(name)
        ax.plot(error.distance_m, error.error_m * 1e3, linestyle="", marker=look["marker"],
                color=look["color"], fillstyle="none", alpha=0.7)  # fmt: skip
        steps = by_distance(error)
        middle = [(low + high) / 2 for low, high, _, _ in steps]
        ax.plot(middle, [rms * 1e3 for *_, rms in steps], label=solution_name(name), **look)
    _answer(ax, data)
    ax.log_y = True
    ax.set(xlabel="distance (m)", ylabel="error at the work piece (mm)")
    legend_below(figure, [ax], columns=2)
    return figure


def _answer(ax: Axes, data: ReportData) -> None:
    """What all pictures share by distance, and the answer that holds it, too."""
    shared = shared_by_distance(data.calibration or {})
    if shared is not None:
        distance_m, sigma_m = shared
        ax.plot(distance_m, SIGMAS * sigma_m * 1e3, linestyle="--", color="#666666",
                label="calibration as a whole, two sigma")  # fmt: skip
    error = (answer_of(data) or {}).get("error_at_work_piece_m")
    if error is not None:
        ax.axhline(error["p95"] * 1e3, linestyle=":", color="#333333",
                   label=f"answer, 95 %: {millimetres(error['p95'])}")  # fmt: skip
