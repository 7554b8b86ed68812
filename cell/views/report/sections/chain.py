"""The measurement chain as a strip: what was found in each link."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cell.views.report import html
from cell.views.report.data import ReportData

_LINKS = (
    ("clock", "when"),
    ("arm", "where the flange is"),
    ("mount", "flange to camera"),
    ("board", "where the corner is"),
    ("lens", "focus, distortion"),
    ("sensor", "tilt, shutter"),
    ("detector", "what is found"),
)


def chain(data: ReportData) -> str:
    """One box a link, in the order in which a corner becomes a pixel."""
    boxes = "".join(_box(data, link, role) for link, role in _LINKS)
    mixups = [_label(e) for e in _effects(data, "bookkeeping")]
    note = html.paragraph(f"Log: {', '.join(mixups)}.", "bad-note") if mixups else ""
    return f'<section id="chain"><ol class="chain">{boxes}</ol>{note}</section>'


def _box(data: ReportData, link: str, role: str) -> str:
    css, mark, message = _state(data, link)
    return (
        f'<li class="{css}"><strong>{html.text(link)}</strong>'
        f'<span class="role">{html.text(role)}</span>'
        f"<span>{mark} {html.text(message)}</span></li>"
    )


def _state(data: ReportData, link: str) -> tuple[str, str, str]:
    if link == "detector" and not _effects(data, link):
        return "untested", "·", _detector(data)
    if data.diagnosis is None:
        return "untested", "·", "not diagnosed"
    unexplained = data.diagnosis.get("unexplained") or {}
    if unexplained.get("link") == link:
        return "bad", "✗", "something unexplained"
    found = _effects(data, link)
    if found:
        return "found", "!", ", ".join(_label(e) for e in found)
    return "good", "✓", "nothing found"


def _detector(data: ReportData) -> str:
    best = data.solutions.get(data.recommended or "", {})
    noise = ((data.diagnosis or {}).get("noise") or {}).get("corner_px")
    rms = best.get("reprojection_px", {}).get("rms")
    if noise is not None:
        return f"noise {noise:.2g} px per axis"
    return "not known" if rms is None else f"RMS {rms:.2g} px"


def _effects(data: ReportData, link: str) -> list[Mapping[str, Any]]:
    return [e for e in (data.diagnosis or {}).get("effects") or [] if e.get("link") == link]


def _label(effect: Mapping[str, Any]) -> str:
    return str(effect["name"]).replace("_", " ")
