"""Evidence for a board that is not as drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from calib.chain.effects import make_effect
from calib.chain.model import CellModel, start
from calib.chain.optics import optics_row
from calib.views import FloatArray
from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLACK
from cell.views.report.plot import Figure, panels
from cell.views.report.plot.axes import Limits


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
    across, down = _extent(corners, board.square_m * 1e3)
    height.image(
        offset[:, 2].reshape(board.rows, board.cols) * 1e3, across, down, colormap="PuOr",
        limits=(-limit, limit), name="z (mm)",
    )  # fmt: skip
    height.set(title="height, away from the viewer", xlabel="x (mm)", ylabel="y (mm)")
    key = float(f"{np.nanmax(np.hypot(*offset[:, :2].T)) * 1e3 or 1.0:.1g}")
    plane.quiver(corners[:, :2], offset[:, :2] * 1e3, unit=key, length=board.square_m * 1e3,
                 colors=[BLACK] * len(corners), key=f"{key:g} mm")  # fmt: skip
    plane.set(title="shift in the plane", xlabel="x (mm)", ylabel="y (mm)", aspect="box", down=True)
    return figure


def _by_law(data: ReportData, effect: Mapping[str, Any]) -> FloatArray | None:
    """(M, 3) corner offsets, metres, that the effect's own law gives with its fitted values."""
    values = {name: e["value"] for name, e in (effect.get("parameters") or {}).items()}
    try:
        present = make_effect(effect["name"], values | _law(effect))
    except KeyError:
        return None
    plain = CellModel(optics_row(), np.eye(4), np.eye(4))
    state = start(plain, data.views.take(np.array([0])), None)
    present.effect.act(present.values, state)
    return np.asarray(state.points_m - data.views.board.corners_m)


def _law(effect: Mapping[str, Any]) -> dict[str, str]:
    return {"law": str(effect["law"])} if effect.get("law") else {}


def _extent(corners_mm: np.ndarray, square_mm: float) -> tuple[Limits, Limits]:
    low, high = corners_mm.min(axis=0) - square_mm / 2, corners_mm.max(axis=0) + square_mm / 2
    return (float(low[0]), float(high[0])), (float(low[1]), float(high[1]))
