"""The report put together: one HTML file that needs nothing else."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from cell.storage.atomic import write_atomically
from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.sections.answer import answer
from cell.views.report.sections.chain import chain
from cell.views.report.sections.coverage import coverage
from cell.views.report.sections.detector import detector
from cell.views.report.sections.findings import diagnosis_section
from cell.views.report.sections.frames import frames
from cell.views.report.sections.lens import lens
from cell.views.report.sections.poses import poses
from cell.views.report.sections.provenance import made
from cell.views.report.sections.tables import tables
from cell.views.report.sections.uncertainty import uncertainty

_SECTIONS = (
    answer,
    chain,
    diagnosis_section,
    poses,
    lens,
    uncertainty,
    detector,
    coverage,
    tables,
    frames,
    made,
)
_LINKS = (
    ("answer", "Answer"),
    ("diagnosis", "Diagnosis"),
    ("arm", "Arm and mount"),
    ("lens", "Lens"),
    ("uncertainty", "Uncertainty"),
    ("detector", "Residuals"),
    ("coverage", "Coverage"),
    ("tables", "Tables"),
    ("frames", "Frames"),
    ("made", "How made"),
)


def render(data: ReportData) -> str:
    """The whole page as HTML text."""
    style = files("cell.views.report").joinpath("style.css").read_text(encoding="utf-8")
    title = html.text(data.recording.get("name") or "calibration")
    links = "".join(f'<a href="#{anchor}">{html.text(heading)}</a>' for anchor, heading in _LINKS)
    body = "\n".join(section(data) for section in _SECTIONS)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Report: {title}</title><style>{style}</style></head>"
        f"<body><nav>{links}</nav><main>{body}</main></body></html>\n"
    )


def write_report(path: Path, data: ReportData) -> None:
    """Write the report to `path` as one self-contained file.

    Parameters
    ----------
    path:
        The file to write; its folder must exist.
    data:
        What is known; the page says what is not.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    write_atomically(path, render(data))
