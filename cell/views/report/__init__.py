"""The report: one self-contained HTML file for the people who use the camera."""

from __future__ import annotations

from cell.views.report.data import Evidence, ReportData, SolutionPoses, Truth
from cell.views.report.from_calibration import solution_poses, solution_residuals
from cell.views.report.from_diagnosis import diagnosis_evidence
from cell.views.report.from_recording import recording_data
from cell.views.report.from_simulation import simulation_truth
from cell.views.report.page import write_report

__all__ = [
    "Evidence",
    "ReportData",
    "SolutionPoses",
    "Truth",
    "diagnosis_evidence",
    "recording_data",
    "simulation_truth",
    "solution_poses",
    "solution_residuals",
    "write_report",
]
