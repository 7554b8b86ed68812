"""The paper's Tables 1 and 2, with uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from calib.calibration.joint_lens import FURTHER_NAMES
from cell.views.numbers import UNKNOWN, number, plus_minus, solution_name, symbol
from cell.views.report import html
from cell.views.report.data import ReportData

_PARAMETERS = ("alpha_px", "beta_px", "u0_px", "v0_px", "skew_px", "k1", "k2")
_WHERE_FREED = FURTHER_NAMES


def tables(data: ReportData) -> str:
    """Reprojection and camera position errors, then the parameters of each solution."""
    if not data.solutions:
        body = html.missing("No solution was computed.")
        return html.section("tables", "Solutions side by side", body)
    return html.section(
        "tables",
        "Solutions side by side",
        _errors(data.solutions),
        _parameters(data.solutions),
        html.paragraph(
            "Uncertainties are one sigma, from each fit's own covariance: they hold where its "
            "model holds, and Zhang's are too small where the focus moved. A value without ± has "
            "no known uncertainty.",
            "small",
        ),
    )


def _errors(solutions: Mapping[str, Mapping[str, Any]]) -> str:
    head = ("solution", "mean (px)", "median (px)", "std (px)", "RMS (px)",
            "x (mm)", "y (mm)", "z (mm)", "RMS (mm)")  # fmt: skip
    rows = [
        (solution_name(name), *_reprojection(s.get("reprojection_px") or {}),
         *_position(s.get("camera_position_error_m") or {}))
        for name, s in solutions.items()
    ]  # fmt: skip
    caption = (
        "Reprojection residuals, and camera position error against the robot as mean ± scatter "
        "of the frames (compare Table 1 of the paper)"
    )
    return html.table(head, rows, caption)


def _reprojection(error: Mapping[str, float]) -> list[str]:
    return [number(error.get(key)) for key in ("mean", "median", "std", "rms")]


def _position(error: Mapping[str, Any]) -> list[str]:
    if not error.get("mean"):
        return [UNKNOWN] * 4
    spread = error.get("std") or [0.0] * 3
    cells = [plus_minus(m * 1e3, s * 1e3) for m, s in zip(error["mean"], spread, strict=True)]
    rms = error.get("rms")
    return [*cells, number(None if rms is None else rms * 1e3)]


def _parameters(solutions: Mapping[str, Mapping[str, Any]]) -> str:
    head = ("parameter", *(solution_name(name) for name in solutions))
    rows = [
        (_head(p), *(_value(s, p) for s in solutions.values()))
        for p in (*_PARAMETERS, *_freed(solutions))
    ]  # fmt: skip
    return html.table(head, rows, "Camera parameters (compare Table 2 of the paper)")


def _freed(solutions: Mapping[str, Mapping[str, Any]]) -> list[str]:
    return [name for name in _WHERE_FREED if any(s.get(name) for s in solutions.values())]


def _head(parameter: str) -> str:
    return symbol(parameter) + (" (px)" if parameter.endswith("_px") else "")


def _value(solution: Mapping[str, Any], parameter: str) -> str:
    if parameter in _WHERE_FREED and not solution.get(parameter):
        return "held at 0"
    sigma = (solution.get("sigma") or {}).get(parameter)
    return plus_minus(solution.get(parameter), sigma)
