"""Coverage: what the frames saw, and what they did not."""

from __future__ import annotations

from math import degrees

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
        f"extrapolates. {_domain(data)}"
    )
    return html.section("coverage", "Coverage: what the frames saw", shown, html.paragraph(message))


def _domain(data: ReportData) -> str:
    """Up to which angle off the axis the recommended camera holds, by its corners and by itself."""
    name = data.recommended
    domain = data.solutions[name].get("domain") if name is not None else None
    if not domain:
        return ""
    wide = data.solutions[name or ""].get("projection") == "equidistant"
    return (
        f"The lens is taken as {'a wide one (equidistant)' if wide else 'perspective'}: corners"
        f" support it up to {degrees(domain['supported_angle_rad']):.0f} degrees off its axis, and"
        f" it can be inverted up to {degrees(domain['invertible_angle_rad']):.0f}; a pixel beyond"
        " has no line of sight."
    )
