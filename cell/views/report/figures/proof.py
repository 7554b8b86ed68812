"""Where the misfit lives, and what the found effects make of frames nobody fitted."""

from __future__ import annotations

from typing import Any

from cell.views.numbers import known
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLACK, BLUE, VERMILLION
from cell.views.report.plot import Figure, panels

_SHOWN = 8


def draw_mismatch(data: ReportData) -> Figure | None:
    """Share of the excess misfit by link and covariate, largest first."""
    rows = [m for m in (data.diagnosis or {}).get("mismatch") or [] if known(m["share_of_excess"])]
    if not rows:
        return None
    rows = sorted(rows, key=lambda m: -m["share_of_excess"])[:_SHOWN][::-1]
    figure, (ax,) = panels(9.2, 0.9 + 0.3 * len(rows))
    shares = [100 * row["share_of_excess"] for row in rows]
    ax.barh([_name(row) for row in rows], shares, [BLUE] * len(rows), "%.0f %%")
    ax.set(xlabel="share of the misfit beyond noise (%)", xlim=(0, max(shares) * 1.12))
    return figure


def draw_holdout(data: ReportData) -> Figure | None:
    """Held-out RMS before and after, with the noise floor."""
    holdout = (data.diagnosis or {}).get("holdout") or {}
    before, after = holdout.get("rms_px_before"), holdout.get("rms_px_after")
    if not known(before) or not known(after):
        return None
    figure, (ax,) = panels(9.2, 1.5)
    ax.barh(["after", "before"], [after, before], [BLUE, VERMILLION], "%.3g px")
    noise = holdout.get("noise_px")
    if known(noise):
        ax.axvline(noise, color=BLACK, linestyle=":", label=f"noise floor {noise:.3g} px")
        ax.legend_at = "lower right"
    ax.set(xlabel="RMS on held-out frames (px)", xlim=(0, 1.18 * max(before, after)))
    return figure


def _name(row: dict[str, Any]) -> str:
    parts = [row.get("site"), row["covariate"], row.get("where")]
    text = ", ".join(str(part) for part in parts if part)
    return f"{row['link']}: {text.replace('_', ' ')}"
