"""Evidence for a board that is not as drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.chain.effects import make_effect
from calib.chain.model import CellModel, start
from calib.chain.optics import optics_row
from calib.views import FloatArray
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLACK, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def shape(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """Height map of the corners, and how far they are shifted in the plane."""
    offset = data.evidence.board_offset_m if data.evidence else None
    if offset is None:
        offset = _by_law(data, effect)
    if offset is None or not np.any(offset):
        return None
    board = data.views.board
    corners = board.corners_m * 1e3
    figure, (height, plane) = panels(9.2, 3.2, columns=2)
    limit = max(float(np.nanmax(np.abs(offset[:, 2]))) * 1e3, 1e-6)
    drawn = height.imshow(
        offset[:, 2].reshape(board.rows, board.cols) * 1e3, cmap="PuOr", vmin=-limit, vmax=limit,
        extent=_extent(corners, board.square_m * 1e3), aspect="equal",
    )  # fmt: skip
    height.set(title="height, away from the viewer", xlabel="x (mm)", ylabel="y (mm)")
    figure.colorbar(drawn, ax=height, shrink=0.8).set_label("z (mm)")
    arrows = plane.quiver(*corners[:, :2].T, *(offset[:, :2].T * 1e3), angles="xy", color=BLACK)
    key = float(f"{np.nanmax(np.hypot(*offset[:, :2].T)) * 1e3 or 1.0:.1g}")
    plane.quiverkey(arrows, 0.85, 1.05, key, f"{key:g} mm", labelpos="E", coordinates="axes")
    plane.set(title="shift in the plane", xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    plane.invert_yaxis()
    return figure


def _by_law(data: ReportData, effect: Mapping[str, Any]) -> FloatArray | None:
    """(M, 3) corner offsets, metres, that the effect's own law gives with its fitted values."""
    values = {name: e["value"] for name, e in (effect.get("parameters") or {}).items()}
    try:
        present = make_effect(effect["name"], values | _law(effect))
    except KeyError:
        return None
    plain = CellModel(optics_row(), np.eye(4), np.eye(4))
    walk = start(plain, data.views.take(np.array([0])), None)
    present.effect.act(present.values, walk)
    return np.asarray(walk.points_m - data.views.board.corners_m)


def _law(effect: Mapping[str, Any]) -> dict[str, str]:
    return {"law": str(effect["law"])} if effect.get("law") else {}


def _extent(corners_mm: np.ndarray, square_mm: float) -> tuple[float, float, float, float]:
    low, high = corners_mm.min(axis=0) - square_mm / 2, corners_mm.max(axis=0) + square_mm / 2
    return float(low[0]), float(high[0]), float(high[1]), float(low[1])
