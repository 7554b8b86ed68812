"""Coverage: what the frames saw, and what they did not."""

from __future__ import annotations

from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.figures import coverage as figure
from cell.views.report.sections.drawing import drawing


def coverage(data: ReportData) -> str:
    """Corners over the image, distances, tilts."""
    if not data.views.seen.any():
        body = html.missing("No corner was found in any frame.")
        return html.section("coverage", "Coverage: what the frames saw", body)
    share = 100 * figure.image_share(data)
    shown = drawing(
        lambda: figure.draw(data),
        "Where corners were seen in the image, at which distances, and how the board was tilted "
        "(rings at 10, 20, 30, 45, 60 degrees).",
        "No corner was found in any frame.",
    )
    message = (
        f"{int(data.views.seen.sum())} corners in {int(data.views.seen.any(axis=1).sum())} frames; "
        f"{share:.0f} % of the image's 8 × 6 cells were seen. Where none was, the calibration "
        "extrapolates."
    )
    return html.section("coverage", "Coverage: what the frames saw", shown, html.paragraph(message))
