"""Sensor and detector: what is left at each corner."""

from __future__ import annotations

from cell.views.numbers import solution_name
from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.figures import residuals
from cell.views.report.sections.drawing import drawing


def detector(data: ReportData) -> str:
    """Residual field and histogram of the recommended solution, and of Zhang's beside it."""
    name = data.best_of(data.residuals_px)
    if name is None:
        body = html.missing("Residuals of single corners are not at hand.")
        return html.section("detector", "Sensor and detector: what is left", body)
    names = dict.fromkeys(n for n in (name, "zhang_mle") if n in data.residuals_px)
    return html.section(
        "detector", "Sensor and detector: what is left", *(_shown(data, n) for n in names)
    )


def _shown(data: ReportData, name: str) -> str:
    return drawing(
        lambda: residuals.draw(data, name),
        f"Residuals of the {solution_name(name)} solution: arrows are means over a cell of the "
        "image, its shade the RMS. Noise leaves arrows without order and a bell in the histogram.",
        f"The {solution_name(name)} solution has no residuals.",
    )
