"""How it was made: recording, versions, hashes."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from cell.views.report import html
from cell.views.report.data import ReportData


def made(data: ReportData) -> str:
    """Everything needed to make it again."""
    rows = [*_flat(data.recording), *data.made.items(), *_versions()]
    return html.section(
        "made",
        "How it was made",
        html.table(("what", "value"), rows),
        html.paragraph(
            "Lengths are metres, angles radians, pixels count from the centre of the top-left "
            "pixel; ± is one sigma unless stated otherwise. Paper: Ricolfe-Viala and Esparza, "
            "arXiv 2402.04686.",
            "small",
        ),
    )


def _flat(content: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for key, value in content.items():
        if isinstance(value, Mapping):
            rows += _flat(value, f"{prefix}{key}: ")
        else:
            rows.append((f"{prefix}{key}", "not known" if value is None else str(value)))
    return rows


def _versions() -> list[tuple[str, str]]:
    return [
        ("calibration-cell", version("calibration-cell")),
        ("Python, NumPy", f"{platform.python_version()}, {np.__version__}"),
    ]
