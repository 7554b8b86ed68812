"""What is left at each corner: over the image, and as a histogram."""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray, Views
from cell.views.numbers import solution_name
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLACK, BLUE, VERMILLION
from cell.views.report.plot import Axes, Figure, panels

_COLUMNS = 14


def draw(data: ReportData, name: str) -> Figure | None:
    """Mean residual vectors over the image and the histogram of solution `name`."""
    residual = data.residuals_px.get(name)
    if residual is None or not np.isfinite(residual).any():
        return None
    figure, axes = panels(9.2, 3.3, columns=2, width_ratios=[1.45, 1])
    field(axes[0], data.views, residual)
    axes[0].set(title=solution_name(name))
    _histogram(axes[1], residual)
    return figure


def cells(views: Views, residual_px: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres (K, 2), mean residuals (K, 2) and RMS (K,) of the image cells with three or more."""
    rows = max(2, round(_COLUMNS * views.height_px / views.width_px))
    known = np.isfinite(residual_px).all(axis=2) & views.seen
    at, left = views.corners_px[known], residual_px[known]
    place = np.floor(at / [views.width_px / _COLUMNS, views.height_px / rows]).astype(int)
    key = place[:, 1] * _COLUMNS + place[:, 0]
    groups = [key == k for k in np.unique(key) if (key == k).sum() >= 3]
    if not groups:
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    centre = np.array([at[g].mean(axis=0) for g in groups])
    mean = np.array([left[g].mean(axis=0) for g in groups])
    rms = np.array([np.sqrt((left[g] ** 2).sum(axis=1).mean()) for g in groups])
    return centre, mean, rms


def field(ax: Axes, views: Views, residual_px: FloatArray, key_px: float | None = None) -> None:
    """Draw the mean residual of each image cell as an arrow, its RMS as a shade."""
    centre, mean, rms = cells(views, residual_px)
    ax.set(xlim=(0, views.width_px), ylim=(views.height_px, 0), aspect="box",
           xlabel="u (px)", ylabel="v (px)", title="mean residual over the image")  # fmt: skip
    if not len(centre):
        return
    ax.squares(centre, rms, size=8.4, name="RMS (px)")
    unit = key_px or _round(float(np.quantile(np.hypot(*mean.T), 0.9)))
    ax.quiver(centre, mean, unit=unit, length=0.9 * views.width_px / _COLUMNS,
              colors=[BLACK] * len(mean), key=f"{unit:g} px")  # fmt: skip


def _histogram(ax: Axes, residual: FloatArray) -> None:
    limit = float(np.nanquantile(np.abs(residual), 0.998)) or 1.0
    edges = np.linspace(-limit, limit, 51)
    looks = ((0, BLUE, "-", "u"), (1, VERMILLION, "--", "v"))
    for axis, colour, line, name in looks:
        values = residual[..., axis][np.isfinite(residual[..., axis])]
        density = np.histogram(values, edges, density=True)[0]
        ax.steps(edges, density, color=colour, linestyle=line, linewidth=1.3,
                 label=f"{name}: σ {values.std():.2g} px")  # fmt: skip
    # the middle of the residuals says how wide the bell would be without outliers
    middle = 1.4826 * float(np.nanmedian(np.abs(residual))) or limit
    bell = np.exp(-0.5 * (edges / middle) ** 2) / (np.sqrt(2 * np.pi) * middle)
    ax.plot(edges, bell, color="#5b616b", linewidth=1,
            label=f"normal, robust σ {middle:.2g} px")  # fmt: skip
    ax.set(title="histogram", xlabel="residual (px)", ylabel="density (1/px)")
    ax.head_room(0.35)
    ax.legend_at = "upper left"


def _round(value: float) -> float:
    """`value` to one significant digit, for a scale arrow one can read."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(np.ceil(value / power) * power)
