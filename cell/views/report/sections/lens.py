"""Lens: the scale factors against distance, the zones, the law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cell.views.numbers import UNKNOWN, known, measured, number, parameters, plus_minus
from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.figures import scale_factors
from cell.views.report.sections.drawing import drawing

_FORMULAS = {
    "inverse_square": "α = α₀ − k/d²",
    "thin_lens": "α = α∞ · d/(d − f)",
    "constant": "α does not change with distance",
    "free": "a smooth curve through nodes",
}


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
    if not zones:
        reason = (data.calibration or {}).get("zones_reason") or data.why_missing("zones")
        return f"Zones were not found: {_spaced(reason)}."
    near = number(zones["near_limit_m"], "m")
    if known(zones.get("near_sigma_m")):
        near = f"{plus_minus(zones['near_limit_m'], zones['near_sigma_m'])} m"
    near = f"at most {near}" if zones.get("near_is_bound") else near
    far = number(zones["far_limit_m"], "m")
    far = f"at least {far}" if zones.get("far_is_bound") else far
    alpha = measured(zones["alpha_px"], zones.get("alpha_sigma_px"), "px")
    beta = measured(zones["beta_px"], zones.get("beta_sigma_px"), "px")
    return (
        f"One scale factor holds (zone 2) from {near} to {far}: α = {alpha}, β = {beta}. Nearer, "
        "it follows the focus (zone 1); farther, the board is too small in the picture to show "
        f"(zone 3). {_sentence(zones.get('why'))}"
    )


def _law(data: ReportData, law: Mapping[str, Any] | None) -> str:
    if not law:
        reason = data.why_missing("focus_law")
        return html.missing(f"No focus law was fitted to scale factors: {reason}.")
    name = str(law["law"])
    prefer = "decisively" if law.get("decisive") else "but not decisively"
    title = (
        f"Focus law the data prefer, {prefer}: {_spaced(name)}, {_FORMULAS.get(name, '')}. "
        f"{_sentence(law.get('why'))}"
    )
    candidates = law.get("candidates") or [law]
    best = min((c["aicc"] for c in candidates if known(c.get("aicc"))), default=None)
    rows = [
        (_spaced(c["law"]), parameters(c.get("parameters") or {}), _difference(c, best),
         number(c.get("scatter"), "", 2))
        for c in candidates
    ]  # fmt: skip
    head = ("law", "parameters of α", "AICc above the best", "scatter over σ")
    return html.paragraph(title) + html.table(head, rows)


def _difference(law: Mapping[str, Any], best: float | None) -> str:
    aicc = law.get("aicc")
    return UNKNOWN if best is None or not known(aicc) else f"{aicc - best:.1f}"


def _sentence(content: object) -> str:
    text = _spaced(content or "").rstrip(".")
    return f"{text[0].upper()}{text[1:]}." if text else ""


def _spaced(name: object) -> str:
    return str(name).replace("_", " ")


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
