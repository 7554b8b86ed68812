"""Lens: the scale factors against distance, the zones, the law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cell.report import html
from cell.report.data import ReportData
from cell.report.figures import scale_factors
from cell.report.numbers import measured, number, symbol
from cell.report.sections.drawing import drawing


def lens(data: ReportData) -> str:
    """The drawing of the paper's Figs. 13 and 14, and what it says."""
    calibration = data.calibration or {}
    shown = drawing(
        lambda: scale_factors.draw(data),
        "Scale factors of the parallel views against distance, zones, fitted law, and the "
        "constants Zhang's method gives. Compare Figs. 13 and 14 of the paper.",
        "No scale factors were measured: that needs views with the board parallel to the image "
        "and known distances.",
    )
    return html.section(
        "lens",
        "Lens: scale factors against distance",
        shown,
        html.paragraph(_zones(data, calibration.get("zones"))),
        _law(data, calibration.get("focus_law")),
        _factors(calibration.get("scale_factors") or []),
    )


def _zones(data: ReportData, zones: Mapping[str, Any] | None) -> str:
    if not zones or "near_limit_m" not in zones:
        reason = (zones or {}).get("reason") or data.why_missing("zones")
        return f"Zones were not found: {reason}."
    return (
        f"One scale factor holds (zone 2) from {number(zones.get('near_limit_m'), 'm')} to "
        f"{number(zones.get('far_limit_m'), 'm')}: α = {number(zones.get('alpha_px'), 'px', 6)}, "
        f"β = {number(zones.get('beta_px'), 'px', 6)}. Nearer, it follows the focus (zone 1); "
        "farther, the board is too small in the picture to tell (zone 3)."
    )


def _law(data: ReportData, law: Mapping[str, Any] | None) -> str:
    if not law or "law" not in law:
        reason = (law or {}).get("reason") or data.why_missing("focus_law")
        return html.missing(f"No focus law was fitted to scale factors: {reason}.")
    rows = [
        (symbol(name), measured(entry["value"], entry.get("sigma"), entry.get("unit", "")))
        for name, entry in (law.get("parameters") or {}).items()
    ]
    formula = {
        "inverse_square": "α = α₀ − k/d²",
        "thin_lens": "α = α∞ · d/(d − f)",
        "constant": "α does not change with distance",
        "free": "a smooth curve through nodes",
    }.get(str(law.get("law")), "")
    why = f" {law['why']}." if law.get("why") else ""
    title = f"Focus law the data prefer: {str(law.get('law')).replace('_', ' ')}, {formula}.{why}"
    return html.paragraph(title) + html.table(("parameter", "value"), rows)


def _factors(factors: list[Mapping[str, Any]]) -> str:
    if not factors:
        return ""
    rows = [
        (f["frame"], number(f["distance_m"], "m", 4),
         measured(f["alpha_px"], f.get("alpha_sigma_px"), "px"),
         measured(f.get("beta_px"), f.get("beta_sigma_px"), "px"))
        for f in factors
    ]  # fmt: skip
    return html.fold("Every measured scale factor",
                     html.table(("frame", "distance", "α", "β"), rows))  # fmt: skip
