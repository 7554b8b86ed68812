"""A comparison as one HTML file: verdicts, tables, and maps over the image."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np

from cell.storage.atomic import write_atomically
from cell.verbs.compare.comparison import Comparison, Difference
from cell.verbs.compare.messages import HEAD, TITLES, parts, table, verdict
from cell.views.provenance_text import provenance_text
from cell.views.report import html
from cell.views.report.figures.canvas import BLACK
from cell.views.report.plot import Figure, panels
from cell.views.report.sections.drawing import drawing


def write_page(path: Path, comparison: Comparison) -> None:
    """Write the page; raises `InputError` where the file cannot be written."""
    write_atomically(path, render(comparison))


def render(comparison: Comparison) -> str:
    """The whole page as HTML text."""
    style = files("cell.views.report").joinpath("style.css").read_text(encoding="utf-8")
    sides = [
        f"{letter}: {side.label}, recording {side.recording}, solution {side.solution}."
        f" {provenance_text(side.origin.model_dump())}"
        for letter, side in (("A", comparison.a), ("B", comparison.b))
    ]
    sections = "".join(
        html.section(
            key,
            TITLES[key],
            html.paragraph(f"{verdict(part)[0].upper()}{verdict(part)[1:]}.", "lead"),
            html.table(HEAD, table(part)),
            _map(comparison, part, TITLES[key]),
        )
        for key, part in parts(comparison).items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Two calibrations compared</title><style>{style}</style></head>"
        f"<body><main><h1>Two calibrations compared</h1>{html.bullets(sides)}{sections}"
        f"{html.bullets(comparison.notes)}</main></body></html>\n"
    )


def _map(comparison: Comparison, part: Difference, title: str) -> str:
    return drawing(
        lambda: draw(comparison, part),
        f"{title}: pixels of B minus A over the image, nearest and farthest distance. Arrows are "
        "drawn to a scale of their own in each map; the shade shows the length.",
        "",
    )


def draw(comparison: Comparison, part: Difference) -> Figure:
    """Maps at the nearest and the farthest distance."""
    figure, axes = panels(9.2, 3.6, columns=2)
    width, height = comparison.a.image_size_px
    pixels = comparison.field.pixels
    for ax, k in zip(axes, (0, -1), strict=True):
        arrows = part.map_px[k]
        length = np.linalg.norm(arrows, axis=1)
        ax.squares(pixels, length, size=7.7, name="difference (px)")
        ax.quiver(pixels, arrows, unit=max(float(length.max()), 1e-9), length=width / 9,
                  colors=[BLACK] * len(pixels))  # fmt: skip
        ax.set(xlim=(0, width), ylim=(height, 0), aspect="box", xlabel="u (px)", ylabel="v (px)")
        ax.set(title=f"at {comparison.field.distances_m[k]:.3f} m")
    return figure
