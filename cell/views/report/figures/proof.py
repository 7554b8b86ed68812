"""Where the misfit lives, and what the found effects make of frames nobody fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLACK, BLUE, GREY, VERMILLION, panels
from cell.views.report.numbers import known

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = 8


def draw_mismatch(data: ReportData) -> Figure | None:
    """Share of the excess misfit by link and covariate, largest first."""
    rows = [m for m in (data.diagnosis or {}).get("mismatch") or [] if known(m["share_of_excess"])]
    if not rows:
        return None
    rows = sorted(rows, key=lambda m: -m["share_of_excess"])[:_SHOWN][::-1]
    figure, (ax,) = panels(9.2, 0.9 + 0.3 * len(rows))
    shares = [100 * row["share_of_excess"] for row in rows]
    bars = ax.barh(range(len(rows)), shares, color=BLUE, height=0.6)
    ax.set_yticks(range(len(rows)), [_name(row) for row in rows])
    ax.bar_label(bars, fmt="%.0f %%", padding=3, fontsize=8)
    ax.set(xlabel="share of the misfit beyond noise (%)", xlim=(0, max(shares) * 1.12))
    ax.grid(axis="y", visible=False)
    return figure


def draw_holdout(data: ReportData) -> Figure | None:
    """Held-out RMS before and after, with the noise floor."""
    holdout = (data.diagnosis or {}).get("holdout") or {}
    before, after = holdout.get("rms_px_before"), holdout.get("rms_px_after")
    if not known(before) or not known(after):
        return None
    figure, (ax,) = panels(9.2, 1.5)
    bars = ax.barh(["after", "before"], [after, before], color=[BLUE, VERMILLION], height=0.55)
    bars[1].set_hatch("//")
    ax.bar_label(bars, fmt="%.3g px", padding=4)
    noise = holdout.get("noise_px")
    if known(noise):
        ax.axvline(noise, color=BLACK, linestyle=":", label=f"noise floor {noise:.3g} px")
        ax.legend(loc="lower right")
    ax.set(xlabel="RMS on held-out frames (px)", xlim=(0, 1.18 * max(before, after)))
    ax.grid(axis="y", visible=False)
    ax.spines["left"].set_color(GREY)
    return figure


def _name(row: dict[str, Any]) -> str:
    parts = [row.get("site"), row["covariate"], row.get("where")]
    words = ", ".join(str(part) for part in parts if part)
    return f"{row['link']}: {words.replace('_', ' ')}"
