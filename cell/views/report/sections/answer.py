"""The first screen: can this camera be used, for what distances, with what error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cell.views.answer_text import answer_text
from cell.views.numbers import UNKNOWN, known, millimetres, number, solution_name
from cell.views.provenance_text import provenance_text
from cell.views.report import html
from cell.views.report.answer_values import answer_of, shared_by_distance
from cell.views.report.data import ReportData
from cell.views.report.figures import workpiece
from cell.views.report.sections.drawing import drawing
from cell.views.report.sections.limitations import sentences
from cell.views.report.sections.transforms import transforms_section
from cell.views.report.workpiece_error import WorkpieceError, by_distance, of_solution

_FIRST = 3

_VERDICTS = {
    "consistent": ("Consistent", "nothing is missing beyond noise", "good"),
    "explained": ("Explained", "known effects account for the misfit down to noise", "note-worthy"),
    "unexplained": ("Unexplained", "something real is left that no known effect accounts for",
                    "bad"),
}  # fmt: skip


def answer(data: ReportData) -> str:
    """Banner, title, the answer in one sentence, its cards, and the drawing that shows it."""
    best = None if data.recommended is None else of_solution(data, data.recommended)
    found = answer_of(data) or {}
    picture = drawing(
        lambda: workpiece.draw(data),
        "Error at the work piece: how far from its true place the arm would meet a part of the "
        "board's size that was located by one picture. Each mark is a frame, lines are the RMS "
        "over a range of distances; dashed what the calibration as a whole may be off by (two "
        "sigma), dotted the answer, which holds both.",
        f"The error at the work piece is not known: {_no_error(found) or 'nothing shows it'}.",
    )
    return (
        f'<section id="answer">{_banner(data)}<h1>{html.text(_title(data))}</h1>'
        f"{html.paragraph(_sentence(data), 'lead')}{_origin(data)}"
        f"{_warnings(data)}"
        f'<div class="cards">{_cards(data)}</div>'
        f"{transforms_section(data)}"
        f'<div class="{_columns(picture)}"><div>{picture}</div><div>{_by_distance(data, best)}'
        f"<h3>What can be trusted</h3>{_first_few(sentences(data))}</div></div></section>"
    )


def _columns(picture: str) -> str:
    """Side by side only where there is something to stand beside: no half page stays empty."""
    return "pair" if "<svg" in picture else ""


def _first_few(items: Sequence[str]) -> str:
    """The sentences that matter for the decision; the others one step away."""
    more = html.fold(f"{len(items) - _FIRST} more", html.bullets(items[_FIRST:]))
    return html.bullets(items[:_FIRST]) + (more if len(items) > _FIRST else "")


def verdict_text(data: ReportData) -> tuple[str, str, str]:
    """Verdict, its meaning, and the style of its card."""
    verdict = (data.diagnosis or {}).get("verdict")
    if verdict in _VERDICTS:
        return _VERDICTS[verdict]
    return "Not diagnosed", "not searched for missing physics: run cell diagnose", ""


def _origin(data: ReportData) -> str:
    """When, of which devices and by which version: of the newest result that is shown."""
    content = data.diagnosis or data.calibration
    return "" if content is None else html.paragraph(provenance_text(content), "small")


def _banner(data: ReportData) -> str:
    if not data.simulated:
        return ""
    effects = ", ".join(data.truth.effects) if data.truth else ""
    more = f" Physics put in: {effects}." if effects else ""
    message = f"no real camera or arm was involved.{more}"
    return f'<p class="simulated"><strong>SIMULATED</strong> — {html.text(message)}</p>'


def _title(data: ReportData) -> str:
    camera = (data.recording.get("camera") or {}).get("model") or "Camera of unknown model"
    robot = (data.recording.get("robot") or {}).get("model")
    place = "on the flange of" if data.views.mount == "eye_in_hand" else "beside"
    where = f" {place} {robot}" if robot else ""
    name = data.recording.get("name")
    return f"{camera}{where}" + (f" · {name}" if name else "")


def _sentence(data: ReportData) -> str:
    if data.calibration is None:
        return f"No calibration was made here. Diagnosis: {verdict_text(data)[1]}."
    return answer_text(answer_of(data)) + _caution(data)


def _warnings(data: ReportData) -> str:
    """What is known to be wrong or undetermined: the first three, the others one step away."""
    found = (data.calibration or {}).get("warnings") or []
    items = [
        f"{w['what']} ({w['where']}). {w['remedy'][:1].upper()}{w['remedy'][1:]}" for w in found
    ]
    if not items:
        return ""
    return (
        f'<div class="warnings" role="alert"><h3>Known to be wrong or not determined</h3>'
        f"{_first_few(items)}</div>"
    )


def _caution(data: ReportData) -> str:
    if (data.diagnosis or {}).get("verdict") != "unexplained":
        return ""
    return " With care: the diagnosis found something that it cannot name (see below)."


def _cards(data: ReportData) -> str:
    found, (verdict, meaning, css) = answer_of(data) or {}, verdict_text(data)
    usable, error = found.get("usable_distances_m"), found.get("error_at_work_piece_m")
    return "".join(
        (
            html.card("Distances", _range(usable), _zone_note(data)),
            html.card(
                "Error at the work piece",
                UNKNOWN if error is None else millimetres(error["p95"]),
                _no_error(found) if error is None else _error_note(error),
            ),
            _reprojection_card(data),
            html.card("Diagnosis", verdict, meaning, css),
        )
    )


def _no_error(found: Mapping[str, Any]) -> str:
    return next((w for w in found.get("limits") or () if not w.startswith("outside")), "")


def _error_note(error: Mapping[str, Any]) -> str:
    each = f"picture by picture {millimetres(error['each_picture_rms'])} RMS"
    shared = error.get("calibration_sigma")
    if shared is None:
        return f"at 95 %; {each} against {error['against']}"
    return f"at 95 %; {each}, the calibration as a whole {millimetres(shared)} (one sigma)"


def _range(usable: Sequence[float] | None) -> str:
    return UNKNOWN if usable is None else f"{usable[0]:.2f} – {usable[1]:.2f} m"


def _zone_note(data: ReportData) -> str:
    law = ((data.calibration or {}).get("focus_law") or {}).get("law")
    if law == "constant":
        return "where one scale factor holds, and frames were taken"
    if law is None:
        return "frames were taken here"
    return f"frames were taken here; the scale factor follows distance ({law.replace('_', ' ')})"


def _reprojection_card(data: ReportData) -> str:
    name = data.recommended
    rms = data.solutions.get(name or "", {}).get("reprojection_px", {}).get("rms")
    note = f"RMS, {solution_name(name)}" if name else "no calibration"
    text = number(rms, "px", 2) if known(rms) else UNKNOWN
    message = f"{note}; poses free, so it says nothing about the error in mm"
    return html.card("Reprojection", text, message)


def _by_distance(data: ReportData, best: WorkpieceError | None) -> str:
    if best is None:
        return ""
    shared = shared_by_distance(data.calibration or {})
    rows = []
    for low, high, frames, rms in by_distance(best):
        whole = None if shared is None else float(np.interp((low + high) / 2, *shared))
        rows.append((f"{low:.2f} – {high:.2f} m", frames, millimetres(rms), millimetres(whole)))
    head = ("distance", "frames", "picture by picture, RMS", "calibration as a whole, one sigma")
    return html.table(head, rows, "Error at the work piece, in its two parts")
