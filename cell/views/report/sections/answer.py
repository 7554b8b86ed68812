"""The first screen: can this camera be used, for what distances, with what error."""

from __future__ import annotations

from typing import Any

import numpy as np

from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.figures import workpiece
from cell.views.report.figures.workpiece import WorkpieceError, by_distance, of_solution
from cell.views.report.numbers import UNKNOWN, known, millimetres, number, solution_name
from cell.views.report.sections.drawing import drawing
from cell.views.report.sections.trust import sentences
from cell.views.report.sections.uncertainty import calibration_sigma_m

_SIGMAS = 2.0

_VERDICTS = {
    "consistent": ("Consistent", "nothing is missing beyond noise", "good"),
    "explained": ("Explained", "known effects account for the misfit down to noise", "note-worthy"),
    "unexplained": ("Unexplained", "something real is left that no known effect accounts for",
                    "bad"),
}  # fmt: skip


def answer(data: ReportData) -> str:
    """Banner, title, the answer in one sentence, its cards, and the drawing that shows it."""
    best = None if data.recommended is None else of_solution(data, data.recommended)
    picture = drawing(
        lambda: workpiece.draw(data),
        "Error at the work piece: how far from its true place the arm would meet a part of the "
        "board's size that was located by one picture. Each mark is a frame, lines are the RMS "
        "over a range of distances.",
        "The error at the work piece is not known: no flange pose was logged, so there is "
        "nothing to hold the camera's poses against.",
    )
    return (
        f'<section id="answer">{_banner(data)}<h1>{html.text(_title(data))}</h1>'
        f"{html.paragraph(_sentence(data, best), 'lead')}"
        f'<div class="cards">{_cards(data, best)}</div>'
        f'<div class="pair"><div>{picture}</div><div>{_by_distance(best)}'
        f"<h3>What can be trusted</h3>{html.bullets(sentences(data))}</div></div></section>"
    )


def verdict_words(data: ReportData) -> tuple[str, str, str]:
    """Verdict, its meaning, and the style of its card."""
    verdict = (data.diagnosis or {}).get("verdict")
    if verdict in _VERDICTS:
        return _VERDICTS[verdict]
    return "Not diagnosed", "not searched for missing physics: run cell diagnose", ""


def usable_m(data: ReportData) -> tuple[float, float] | None:
    """The range of distances the calibration vouches for, metres.

    Where the scale factor's dependence on distance is modelled, that is the range seen; where it
    is taken as constant, zone 2. Without flange poses, what the pictures alone say.
    """
    calibration = data.calibration or {}
    seen = [f["distance_m"] for f in calibration.get("scale_factors") or []]
    best = None if data.recommended is None else of_solution(data, data.recommended)
    if best is not None:
        seen += [float(best.distance_m.min()), float(best.distance_m.max())]
    if not seen:
        by_pictures = calibration.get("distance_range_m")
        return None if by_pictures is None else (by_pictures[0], by_pictures[1])
    low, high = min(seen), max(seen)
    zones: dict[str, Any] = calibration.get("zones") or {}
    law = (calibration.get("focus_law") or {}).get("law")
    if law == "constant":
        if not zones.get("near_is_bound"):
            low = max(low, zones.get("near_limit_m") or low)
        if not zones.get("far_is_bound"):
            high = min(high, zones.get("far_limit_m") or high)
    return low, high


def _banner(data: ReportData) -> str:
    if not data.simulated:
        return ""
    effects = ", ".join(data.truth.effects) if data.truth else ""
    more = f" Physics put in: {effects}." if effects else ""
    words = f"no real camera or arm was involved.{more}"
    return f'<p class="simulated"><strong>SIMULATED</strong> — {html.text(words)}</p>'


def _title(data: ReportData) -> str:
    camera = (data.recording.get("camera") or {}).get("model") or "Camera of unknown model"
    robot = (data.recording.get("robot") or {}).get("model")
    place = "on the flange of" if data.views.mount == "eye_in_hand" else "beside"
    where = f" {place} {robot}" if robot else ""
    name = data.recording.get("name")
    return f"{camera}{where}" + (f" · {name}" if name else "")


def _sentence(data: ReportData, best: WorkpieceError | None) -> str:
    if data.calibration is None:
        return f"No calibration was made here. Diagnosis: {verdict_words(data)[1]}."
    usable = usable_m(data)
    if usable is None:
        return (
            "The camera was calibrated, but neither its distances nor its error at the work "
            "piece are known from this recording."
        )
    span = f"from {usable[0]:.2f} to {usable[1]:.2f} m"
    if best is None:
        return (
            f"The calibration covers distances {span}. Its error at the work piece is not known, "
            "because no flange pose was logged."
        )
    shared = calibration_sigma_m(data)
    frames = f"95 % of {_frames(data, best)} stay below"
    if shared is None:
        why = f"{frames} that, measured against {best.against}."
    else:
        why = (
            f"{frames} {millimetres(best.p95_m)} against {best.against}, and the calibration as a "
            f"whole may be off by {millimetres(_SIGMAS * shared)} (two sigma)."
        )
    allows = millimetres(allowance_m(data, best))
    return f"Use this camera {span}, for work that allows {allows} at the work piece: {why}" + (
        _caution(data)
    )


def allowance_m(data: ReportData, best: WorkpieceError) -> float:
    """What the work piece must allow: from picture to picture, and of all pictures together."""
    return float(np.hypot(best.p95_m, _SIGMAS * (calibration_sigma_m(data) or 0.0)))


def _frames(data: ReportData, best: WorkpieceError) -> str:
    known_in, all_of = len(best.error_m), len(data.views)
    return f"{known_in} frames" if known_in == all_of else f"{known_in} of {all_of} frames"


def _caution(data: ReportData) -> str:
    if (data.diagnosis or {}).get("verdict") != "unexplained":
        return ""
    return " With care: the diagnosis found something that it cannot name (see below)."


def _cards(data: ReportData, best: WorkpieceError | None) -> str:
    usable, (verdict, meaning, css) = usable_m(data), verdict_words(data)
    return "".join(
        (
            html.card(
                "Distances",
                _range(usable),
                _zone_note(data),
            ),
            html.card(
                "Error at the work piece",
                UNKNOWN if best is None else millimetres(allowance_m(data, best)),
                "no flange pose was logged" if best is None else _error_note(data, best),
            ),
            _reprojection_card(data),
            html.card("Diagnosis", verdict, meaning, css),
        )
    )


def _error_note(data: ReportData, best: WorkpieceError) -> str:
    shared = calibration_sigma_m(data)
    each = f"picture by picture {millimetres(best.rms_m)} RMS against {best.against}"
    if shared is None:
        return each
    return f"at 95 %; {each}, all together {millimetres(shared)} (one sigma)"


def _range(usable: tuple[float, float] | None) -> str:
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
    return html.card("Reprojection", text, f"{note}; says nothing about the error in mm")


def _by_distance(best: WorkpieceError | None) -> str:
    if best is None:
        return ""
    rows = [
        (f"{low:.2f} – {high:.2f} m", frames, millimetres(rms))
        for low, high, frames, rms in by_distance(best)
    ]
    return html.table(("distance", "frames", "error at the work piece, RMS"), rows)
