"""Evidence for what shows in the image alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cell.views.report.data import ReportData
from cell.views.report.figures.residuals import cells, field
from cell.views.report.plot import Figure, panels


def before_and_after(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """Residual field of the plain and of the final model, arrows to one scale."""
    found = data.evidence
    if found is None or found.before_px is None:
        return None
    shown = [("plain model", found.before_px)]
    if found.after_px is not None:
        shown.append(("with what was found", found.after_px))
    _, mean, _ = cells(data.views, found.before_px)
    if not len(mean):
        return None
    key = float(f"{np.quantile(np.hypot(*mean.T), 0.9) or 1.0:.1g}")
    figure, axes = panels(9.2, 3.2, columns=len(shown))
    for ax, (name, residual) in zip(axes, shown, strict=True):
        field(ax, data.views, residual, key)
        ax.set(title=name)
    return figure
