"""A check as one HTML file: the answer first, then where the misfit is."""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from cell.storage.files.verify_file import VerifyFile
from cell.verbs.verify.check import Checked
from cell.verbs.verify.judge import Judgement
from cell.verbs.verify.messages import (
    DISTANCE_HEAD,
    FRAME_HEAD,
    HEADS,
    IMAGE_HEAD,
    distance_rows,
    frame_rows,
    image_rows,
)
from cell.verbs.verify.misfit import Misfit
from cell.views.provenance_text import provenance_text
from cell.views.report import html
from cell.views.report.figures.canvas import BLACK
from cell.views.report.plot import Figure, panels
from cell.views.report.plot.colours import colours
from cell.views.report.sections.drawing import drawing

_STYLE = {"good": "good", "within_tolerance": "good", "cannot_tell": "note-worthy"}


def render(checked: Checked, *, simulated: bool) -> str:
    """The whole page as HTML text."""
    found = checked.content
    style = files("cell.views.report").joinpath("style.css").read_text(encoding="utf-8")
    banner = (
        '<p class="simulated"><strong>SIMULATED</strong> — no real camera or arm was involved.</p>'
        if simulated
        else ""
    )
    title = f"Is the calibration of {html.text(found.recording)} still good?"
    first = (
        f'<section id="answer">{banner}<h1>{title}</h1>{html.paragraph(found.sentence, "lead")}'
        f"{html.paragraph(provenance_text(found.model_dump(mode='json')), 'small')}"
        f'<div class="cards">{_cards(found)}</div>{html.bullets(found.notes)}</section>'
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Calibration checked: {html.text(found.recording)}</title><style>{style}</style>"
        f"</head><body><main>{first}{_where(checked)}{_frames(found)}</main></body></html>\n"
    )


def _cards(found: VerifyFile) -> str:
    p_value = found.p_value
    cards = [
        html.card(
            "Verdict",
            HEADS[found.verdict],
            "nothing could be held against it"
            if p_value is None
            else f"p = {p_value:.2g} of a misfit as large by chance",
            _STYLE.get(found.verdict, "bad"),
        )
    ]
    if found.frames:
        worst = max(found.frames, key=lambda f: f.workpiece_m)
        cards.append(
            html.card(
                "Error at the work piece",
                f"{1e3 * worst.workpiece_m:.2f} mm",
                f"with the old calibration, worst of {len(found.frames)} frames (at"
                f" {worst.distance_m:.2f} m)",
            )
        )
    cards.append(_length_card(found))
    if found.noticeable is not None:
        notice = found.noticeable
        cards.append(
            html.card(
                "Would have been noticed",
                f"{1e3 * notice.workpiece_m:.2f} mm",
                f"at the work piece, nine times in ten: a shift of {1e3 * notice.shift_m:.2f} mm, a"
                f" turn of {1e3 * notice.turn_rad:.2f} mrad, {1e2 * notice.alpha_share:.3f} % of"
                " the focal length",
            )
        )
    return "".join(cards)


def _length_card(found: VerifyFile) -> str:
    length = found.length
    if length is None:
        return html.card("Known length", "not given", "no measurement but camera and robot")
    return html.card(
        "Error of length measurement",
        f"{1e3 * length.error_m:+.3f} mm",
        f"± {1e3 * length.sigma_m:.3f} mm (one sigma) on {1e3 * length.known_m:.3f} mm, from"
        f" {length.frames} poses; one length, no acceptance test",
        "good" if length.p_value >= 0.01 else "bad",
    )


def _where(checked: Checked) -> str:
    found, judgement, misfit = checked.content, checked.judgement, checked.misfit
    if judgement is None or misfit is None:
        return ""
    picture = drawing(
        lambda: draw(judgement, misfit),
        "Seen less predicted by the old calibration, the board where it fits best. Left: over the "
        "image, arrows to a scale of their own. Right: each frame by its distance, with one sigma "
        "by the uncertainties of calibration, arm and corners, and what they exceed once in a "
        "hundred times.",
        "",
    )
    return html.section(
        "where",
        "Where the old calibration misses, and by how much",
        picture,
        html.table(DISTANCE_HEAD, distance_rows(found)),
        html.table(IMAGE_HEAD, image_rows(found)),
    )


def _frames(found: VerifyFile) -> str:
    left = [f"frame {f.frame} left out: {f.reason}" for f in found.frames_left_out]
    table = html.table(FRAME_HEAD, frame_rows(found)) if found.frames else ""
    return html.section("frames", "Frames, the worst first", table, html.bullets(left))


def draw(judgement: Judgement, misfit: Misfit) -> Figure:
    """The misfit over the image, and over distance."""
    views, off = judgement.views, misfit.residual_px
    figure, (image, distance) = panels(9.2, 3.6, columns=2)
    seen = np.isfinite(off).all(axis=2)
    at, arrows = views.corners_px[seen], off[seen]
    length = np.linalg.norm(arrows, axis=1)
    long = max(float(np.quantile(length, 0.95)), 1e-9)
    image.quiver(at, arrows, unit=long, length=views.width_px / 15,
                 colors=colours(length, "cividis_r", 0.0, float(length.max())))  # fmt: skip
    image.set(xlim=(0, views.width_px), ylim=(views.height_px, 0), aspect="box")
    image.set(xlabel="u (px)", ylabel="v (px)")
    rms = np.sqrt(np.nanmean((off**2).sum(axis=2), axis=1))
    sigma, limit = misfit.expected_each()
    look = {"linestyle": "", "color": BLACK}
    distance.plot(misfit.distance_m, rms, marker="o", label="misfit", **look)
    distance.plot(misfit.distance_m, sigma, marker="_", markersize=8.0, label="one sigma", **look)
    distance.plot(misfit.distance_m, limit, marker="_", markersize=14.0,
                  label="limit: one in a hundred beyond", **look)  # fmt: skip
    top = 1.4 * float(np.nanmax([rms, limit]))
    distance.set(xlabel="distance (m)", ylabel="RMS (px)", ylim=(0, top))
    distance.legend_at = "upper left"
    return figure
