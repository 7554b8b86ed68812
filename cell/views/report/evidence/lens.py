"""Evidence for what the lens does with distance."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from cell.views.report.data import ReportData
from cell.views.report.evidence.scatter import (
    WITH,
    WITHOUT,
    Pair,
    before_after,
    component,
    shifts_m,
)
from cell.views.report.figures.canvas import BLACK, BLUE, GREY, ORANGE
from cell.views.report.figures.scale_factors import law_px
from cell.views.report.geometry import frame_distance_m
from cell.views.report.plot import Axes, Figure, legend_below, panels


def alpha_and_depth(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """α of each frame at the robot's depth, and the depth error, against distance."""
    distance, shifts = frame_distance_m(data), shifts_m(data, effect)
    alpha = data.evidence.alpha_px if data.evidence else None
    if distance is None or (shifts is None and alpha is None):
        return None
    figure, axes = panels(9.2, 3.2, columns=(alpha is not None) + (shifts is not None))
    if alpha is not None:
        _alpha(axes[0], data, effect, distance)
    if shifts is not None:
        _depth(axes[-1], shifts, distance)
    legend_below(figure, axes, columns=4)
    return figure


def by_focus_direction(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """Depth error against distance, split by the direction from which focus was reached."""
    distance, shifts = frame_distance_m(data), shifts_m(data, effect)
    if distance is None or shifts is None:
        return None
    focus = data.views.focus_position
    came = np.diff(focus if np.isfinite(focus).all() else distance, prepend=np.nan)
    names = (WITHOUT, WITH)
    shown = [(n, s) for n, s in zip(names, shifts, strict=True) if s is not None]
    figure, axes = panels(9.2, 3.2, columns=len(shown), sharey=True)
    for ax, (name, shift) in zip(axes, shown, strict=True):
        for sign, marker, colour, way in ((1, "^", ORANGE, "rising"), (-1, "v", BLUE, "falling")):
            chosen = np.sign(came) == sign
            ax.plot(distance[chosen], shift[chosen, 2] * 1e3, marker=marker, linestyle="",
                    color=colour, fillstyle="none", label=f"focus {way}")  # fmt: skip
        ax.set(title=name, xlabel="distance (m)")
    axes[0].set(ylabel="depth error (mm)")
    legend_below(figure, axes)
    return figure


def by_exposure(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """Depth error against the exposure, or against the gain where that does more."""
    shifts = shifts_m(data, effect)
    by_gain = "px_per_dB" in effect["parameters"] and "px_per_s" not in effect["parameters"]
    along = data.views.logged("gain_db") if by_gain else data.views.exposure_s * 1e3
    if shifts is None or not np.isfinite(along).any():
        return None
    figure, axes = panels(6.0, 3.2)
    _depth(axes[0], shifts, along)
    axes[0].set(xlabel="gain (dB)" if by_gain else "exposure (ms)")
    legend_below(figure, axes)
    return figure


def _alpha(ax: Axes, data: ReportData, effect: Mapping[str, Any], distance: np.ndarray) -> None:
    found = data.evidence
    assert found is not None
    assert found.alpha_px is not None
    sigma = np.zeros(len(distance)) if found.alpha_sigma_px is None else found.alpha_sigma_px
    ax.errorbar(distance, found.alpha_px, np.nan_to_num(sigma), marker="x", color=BLACK,
                ecolor=GREY, label="α at the robot's depth, ± 1σ")  # fmt: skip
    grid = np.linspace(np.nanmin(distance), np.nanmax(distance), 120)
    curve = law_px(_with_base(effect, data), grid)
    if curve is not None:
        ax.plot(grid, curve, color=BLUE, label="law found")
    ax.set(title="scale factor", xlabel="distance (m)", ylabel="α (px)")


def _with_base(effect: Mapping[str, Any], data: ReportData) -> dict[str, Any] | None:
    """The effect's law with α at far focus, where the diagnosis or the calibration names it."""
    own = dict(effect.get("parameters") or {})
    fitted = ((data.calibration or {}).get("focus_law") or {}).get("parameters") or {}
    whole = {**{k: v for k, v in fitted.items() if k.startswith("alpha")}, **own}
    needed = {
        "inverse_square": {"alpha0_px", "k_px_m2"},
        "thin_lens": {"alpha_inf_px", "f_m"},
    }.get(str(effect.get("law")))
    if needed is None or not needed <= set(whole):
        return None
    return {"law": effect["law"], "parameters": whole}


def _depth(ax: Axes, shifts: Pair, distance: np.ndarray) -> None:
    before_after(ax, distance, shifts, partial(component, axis=2))
    ax.set(title="depth error against the robot", xlabel="distance (m)", ylabel="error (mm)")
