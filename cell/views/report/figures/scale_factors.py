"""Scale factors against distance: the paper's Figs. 13 and 14, with error bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.views.numbers import solution_name
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLACK, GREEN, GREY, style
from cell.views.report.geometry import best_poses, distance_m
from cell.views.report.plot import Axes, Figure, legend_below, panels


def draw(data: ReportData) -> Figure | None:
    """α and β of each parallel view against distance, or None where none was measured."""
    factors = (data.calibration or {}).get("scale_factors") or []
    if not factors and not any(p.scale_px is not None for p in data.poses.values()):
        return None
    figure, axes = panels(9.2, 3.9, columns=2, sharex=True)
    for ax, letter in zip(axes, ("alpha", "beta"), strict=True):
        _panel(ax, data, factors, letter)
    legend_below(figure, axes)
    return figure


def law_px(law: Mapping[str, Any] | None, distance: FloatArray) -> FloatArray | None:
    """The fitted focus law at `distance`, or None where it is not a closed formula."""
    if not law:
        return None
    value = {name: entry["value"] for name, entry in (law.get("parameters") or {}).items()}
    match law.get("law"):
        case "inverse_square":
            return np.asarray(value["alpha0_px"] - value["k_px_m2"] / distance**2)
        case "thin_lens":
            return np.asarray(value["alpha_inf_px"] * distance / (distance - value["f_m"]))
        case "constant":
            return np.full_like(distance, value["alpha_px"])
    return None


def _panel(ax: Axes, data: ReportData, factors: list[Mapping[str, float]], letter: str) -> None:
    distance = _column(factors, "distance_m")
    value = _column(factors, f"{letter}_px")
    sigma = _column(factors, f"{letter}_sigma_px")
    greek = {"alpha": "α", "beta": "β"}[letter]
    if factors:
        ax.errorbar(distance, value, np.nan_to_num(sigma), marker="x", color=BLACK, ecolor=GREY,
                    label="measured, ± 1σ", zorder=4)  # fmt: skip
        _zones(ax, data, letter, distance)
        _law(ax, data, letter, distance)
    _moving(ax, data, letter)
    _constants(ax, data, letter)
    _truth(ax, data, letter)
    ax.head_room(0.09)  # for the zones' names
    ax.set(title=f"{greek} against distance", xlabel="distance (m)", ylabel=f"{greek} (px)")


def _zones(ax: Axes, data: ReportData, letter: str, distance: FloatArray) -> None:
    zones = (data.calibration or {}).get("zones") or {}
    near, far = zones.get("near_limit_m"), zones.get("far_limit_m")
    if near is None and far is None:
        return
    low, high = np.nanmin(distance), np.nanmax(distance)
    margin = 0.03 * (high - low)
    near = low - margin if near is None else near
    far = high + margin if far is None else far
    ax.axvspan(near, far, color="#eaf3fa")
    for start, end, number in ((low, near, 1), (near, far, 2), (far, high, 3)):
        if end - start > 0.04 * (high - low):
            _zone_name(ax, (start + end) / 2, f"zone {number}")
    if zones.get(f"{letter}_px") is not None:
        mean = zones[f"{letter}_px"]
        ax.plot([near, far], [mean, mean], color=BLACK, label="mean of zone 2")


def _zone_name(ax: Axes, x: float, label: str) -> None:
    ax.annotate(label, x, np.inf, up=-10, anchor="middle", color="#5b616b")


def _law(ax: Axes, data: ReportData, letter: str, distance: FloatArray) -> None:
    law = (data.calibration or {}).get("focus_law")
    if law and letter == "beta":
        law = {**law, "parameters": law.get("beta_parameters")}
    if not law or not law["parameters"]:
        return
    grid = np.linspace(np.nanmin(distance), np.nanmax(distance), 120)
    curve = law_px(law, grid)
    if curve is not None:
        label = str(law["law"]).replace("_", " ")
        ax.plot(grid, curve, color=GREEN, linestyle="-.", label=f"fitted law: {label}")


def _moving(ax: Axes, data: ReportData, letter: str) -> None:
    """The scale factor the best solution gives each view, where it moves with focus."""
    poses, name = best_poses(data), data.best_of(data.poses)
    if poses is None or poses.scale_px is None or name is None:
        return
    distance = distance_m(poses.board_from_camera, data.views.board)
    order = np.argsort(distance)
    scale = poses.scale_px[:, ("alpha", "beta").index(letter)]
    ax.plot(distance[order], scale[order], color=style(name)["color"], linewidth=1,
            label=solution_name(name), zorder=3)  # fmt: skip


def _constants(ax: Axes, data: ReportData, letter: str) -> None:
    for name in ("zhang_mle", "zhang_algebraic"):
        value = data.solutions.get(name, {}).get(f"{letter}_px")
        if value is not None:
            look = {**style(name), "marker": ""}
            ax.axhline(value, label=solution_name(name), **look)


def _truth(ax: Axes, data: ReportData, letter: str) -> None:
    truth = getattr(data.truth, f"{letter}_px", None)
    poses = best_poses(data)
    if truth is None or data.truth is None:
        return
    where = data.truth.board_from_camera
    if where is None and poses is not None:
        where = poses.board_from_camera
    if where is not None:
        ax.plot(
            distance_m(where, data.views.board), truth, marker=".", linestyle="", color=GREY,
            label="simulator's truth", zorder=1,
        )  # fmt: skip


def _column(rows: list[Mapping[str, float]], name: str) -> FloatArray:
    return np.array([np.nan if row.get(name) is None else row[name] for row in rows], dtype=float)
