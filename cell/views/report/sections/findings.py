"""The diagnosis in order: where it hurts, what it is, how sure, what it costs, what to do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cell.views.numbers import (
    UNKNOWN,
    known,
    millimetres,
    number,
    parameters,
    probability,
)
from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.evidence import law, picture_of, remedy_of
from cell.views.report.figures import proof
from cell.views.report.sections.answer import verdict_text
from cell.views.report.sections.drawing import drawing
from cell.views.unnamed import look_at, sentence


def diagnosis_section(data: ReportData) -> str:
    """The whole diagnosis, or that there was none."""
    if data.diagnosis is None:
        message = "No diagnosis was made: “cell diagnose” makes one from this recording."
        return html.section("diagnosis", "Diagnosis", html.missing(message))
    verdict, meaning, _ = verdict_text(data)
    return html.section(
        "diagnosis",
        f"Diagnosis: {verdict.lower()}",
        html.paragraph(f"{meaning[0].upper()}{meaning[1:]}.", "lead"),
        _where(data),
        *(_effect(data, effect) for effect in data.diagnosis.get("effects") or []),
        _unexplained(data),
        _rivals(data.diagnosis),
        _holdout(data),
        _notes(data.diagnosis.get("notes") or []),
    )


def _notes(notes: list[str]) -> str:
    if not notes:
        return ""
    title = "What was worked out, and what could not be seen"
    return f"<h3>{title}</h3>{html.bullets(note.replace('_', ' ') for note in notes)}"


def _where(data: ReportData) -> str:
    rows = (data.diagnosis or {}).get("mismatch") or []
    if not rows:
        return html.paragraph("No link of the chain shows a misfit beyond noise.")
    table = html.table(
        ("link", "site", "along", "where", "share of excess", "p"),
        [
            (m["link"], m.get("site") or "", m["covariate"], m.get("where") or "everywhere",
             _share(m["share_of_excess"]), probability(m.get("p_value")))
            for m in rows
        ],
    )  # fmt: skip
    shown = drawing(
        lambda: proof.draw_mismatch(data),
        "Where the misfit beyond noise lives: link of the chain, what it follows, in which range. "
        "Shares overlap where two quantities changed together during the run.",
        "The shares of the misfit were not measured.",
    )
    return f"<h3>Where it hurts</h3>{shown}{html.fold('All places, with p-values', table)}"


def _effect(data: ReportData, effect: Mapping[str, Any]) -> str:
    name = str(effect["name"]).replace("_", " ")
    law = f" ({str(effect['law']).replace('_', ' ')})" if effect.get("law") else ""
    remedy = remedy_of(effect) or "No remedy is on file for this effect."
    facts = html.table(
        ("question", "answer"),
        [
            ("What it is", effect.get("physics") or "not described"),
            ("How large", parameters(effect.get("parameters") or {}) or "no parameters"),
            ("How sure", _confidence(effect)),
            ("What it costs", _cost(data, effect)),
            ("What to do", remedy),
        ],
    )  # fmt: skip
    return (
        f'<article class="effect"><h3>{html.text(effect.get("link"))}: {html.text(name + law)}</h3>'
        f'<div class="facts">{facts}</div>{_picture(data, effect)}</article>'
    )


def _confidence(effect: Mapping[str, Any]) -> str:
    gain = effect.get("holdout_gain_px")
    held = f"; held-out frames improve by {number(gain, 'px', 2)}" if gain else ""
    return f"p {probability(effect.get('p_value'))}{held}"


def _picture(data: ReportData, effect: Mapping[str, Any]) -> str:
    picture = picture_of(effect)
    if picture is None:
        return html.missing("No drawing is registered for this effect.")
    name = str(effect["name"]).replace("_", " ")
    return drawing(
        lambda: picture.draw(data, effect),
        f"{name}. {picture.look_for}",
        f"Not drawn: it needs {picture.needs}.",
    )


def _cost(data: ReportData, effect: Mapping[str, Any]) -> str:
    """What leaving this effect out costs at the tool, or else all that was found together."""
    found = data.evidence
    if found is None or found.shift_before_m is None:
        return "in mm not known: no per-frame pose errors were measured"
    alone = found.cost_m.get(effect["name"])
    if alone is None:
        without = f"the camera is {millimetres(_rms(found.shift_before_m))} RMS off without it"
    else:
        without = (
            f"left out alone, and hand-eye solved again: the camera {millimetres(alone)} RMS off"
        )
    if found.shift_after_m is None:
        return without
    return f"{without}; {millimetres(_rms(found.shift_after_m))} with all that was found"


def _unexplained(data: ReportData) -> str:
    every = (data.diagnosis or {}).get("unexplained_all") or []
    if not every:
        return ""
    reported = "".join(_without_a_name(data, left) for left in every)
    return f"<h3>What nobody can name</h3>{reported}"


def _without_a_name(data: ReportData, left: Mapping[str, Any]) -> str:
    """A sentence, the law with its numbers, what to look at on the machine, and a picture."""
    found = left.get("law") or {}
    gain = found.get("holdout_gain_px")
    rows = [
        ("What it does", sentence(left)),
        ("Its equation", found.get("equation") or ""),
        ("How large", parameters(found.get("parameters") or {})),
        ("How sure", f"p {probability(left.get('p_value'))}"),
        (
            "What it costs",
            "" if gain is None else f"held-out frames are {gain:.2f} px worse without",
        ),
        ("What to look at", look_at(left)),
        ("Other laws that fit", "; ".join(found.get("rivals") or [])),
    ]
    facts = html.table(("question", "answer"), [row for row in rows if row[1]])
    title = f"{left['link']}: {str(left['site']).replace('_', ' ')}"
    return (
        f'<article class="effect"><h3>{html.text(title)}</h3><div class="facts">{facts}</div>'
        f"{_interval_table(found)}{_law_picture(data, left)}</article>"
    )


def _interval_table(found: Mapping[str, Any]) -> str:
    """Every number of a law with the interval that holds it in 19 of 20 runs."""
    rows = [
        (name.replace("_", " "), f"{v['value']:.4g}", _interval(v["value"], v["sigma"]), v["unit"])
        for name, v in (found.get("parameters") or {}).items()
    ]
    if not rows:
        return ""
    return html.table(("number", "value", "95 % interval", "unit"), rows)


def _interval(value: float, sigma: float) -> str:
    if not sigma:
        return "as found, not estimated"
    return f"{value - 1.96 * sigma:.4g} to {value + 1.96 * sigma:.4g}"


def _law_picture(data: ReportData, left: Mapping[str, Any]) -> str:
    """The law over what it follows; of a field, what shows its link."""
    figure = law.shape(data, left)
    if figure is not None:
        return html.figure(figure.svg(law.LOOK_FOR), law.LOOK_FOR)
    link = picture_of({"name": "", "link": left["link"]})
    if link is None:
        return ""
    shown = link.draw(data, {"name": "", "link": left["link"]})
    return "" if shown is None else html.figure(shown.svg(link.look_for), link.look_for)


def _rivals(diagnosis: Mapping[str, Any]) -> str:
    rows = diagnosis.get("ambiguous_with") or []
    if not rows:
        return "<h3>What else it could be</h3>" + html.paragraph(
            "No other known effect explains the recording as well."
        )
    table = html.table(
        ("could also be", "because", "what would distinguish them"),
        [
            (", ".join(n.replace("_", " ") for n in row["names"]), row.get("why") or "",
             _separation(row))
            for row in rows
        ],
    )  # fmt: skip
    return f"<h3>What else it could be</h3>{table}"


def _separation(row: Mapping[str, Any]) -> str:
    if row.get("separate_with"):
        return f"cell run {row['separate_with']}"
    return str(row.get("experiment") or "no pose plan can")


def _holdout(data: ReportData) -> str:
    holdout = (data.diagnosis or {}).get("holdout") or {}
    frames = holdout.get("frames")
    count = len(frames) if isinstance(frames, list | tuple) else frames
    shown = drawing(
        lambda: proof.draw_holdout(data),
        f"The proof: {count} frames that took no part in any fit, before (plain model) and after "
        "(with what was found); the dotted line is what noise alone would leave.",
        "No frames were held out, so there is no proof beyond the fit itself.",
    )
    return f"<h3>Does it hold on frames nobody fitted?</h3>{shown}"


def _rms(shift_m: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean((shift_m**2).sum(axis=1))))


def _share(value: float | None) -> str:
    return f"{100 * value:.0f} %" if known(value) else UNKNOWN
