"""Where a cell would show the corners at poses that nobody has shown it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from calib.chain.model import CellModel, predict
from calib.views import Views
from cell.storage.atomic import atomic_file

BEFORE = "predicted_corners_before.csv"
AFTER = "predicted_corners.csv"


def write_prediction(path: Path, model: CellModel, views: Views) -> None:
    """Write `frame,row,col,u_px,v_px` of every corner of every frame that has a pose."""
    pixels = predict(model, views)
    with atomic_file(path, newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "row", "col", "u_px", "v_px"])
        for frame, corners in zip(views.frame, pixels, strict=True):
            if not np.isfinite(corners).all():
                continue
            for index, (u, v) in enumerate(corners):
                row, col = divmod(index, views.board.cols)
                rows.writerow([int(frame), row, col, f"{u:.4f}", f"{v:.4f}"])
