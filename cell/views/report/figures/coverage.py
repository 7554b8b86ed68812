"""Where the frames looked: over the image, over distance, over tilt."""

from __future__ import annotations

import numpy as np

from cell.views.report.data import ReportData
from cell.views.report.figures.canvas import BLUE
from cell.views.report.geometry import best_poses, distance_m, tilt_direction_rad, tilt_rad
from cell.views.report.plot import Axes, Figure, panels


def draw(data: ReportData) -> Figure | None:
    """Corner counts over the image, and distances and tilts where poses are known."""
    if not data.views.seen.any():
        return None
    poses = best_poses(data)
    columns = 1 if poses is None else 3
    figure, axes = panels(9.2 if poses else 5.0, 2.9, columns=columns,
                          width_ratios=[1.5, 1, 1][:columns])  # fmt: skip
    _image(axes[0], data)
    if poses is not None:
        _distances(axes[1], data, poses.board_from_camera)
        _tilts(axes[2], poses.board_from_camera)
    return figure


def image_share(data: ReportData, columns: int = 8, rows: int = 6) -> float:
    """The share of an 8 × 6 grid of image cells in which at least one corner was seen."""
    counts = _counts(data, columns, rows)
    return float((counts > 0).mean())


def _counts(data: ReportData, columns: int, rows: int) -> np.ndarray[tuple[int, ...], np.dtype]:
    views = data.views
    at = views.corners_px[views.seen]
    return np.histogram2d(
        at[:, 1], at[:, 0], bins=(rows, columns),
        range=((0, views.height_px), (0, views.width_px)),
    )[0]  # fmt: skip


def _image(ax: Axes, data: ReportData) -> None:
    views = data.views
    counts = np.where((found := _counts(data, 24, 18)) > 0, found, np.nan)
    ax.image(counts, (0, views.width_px), (0, views.height_px), colormap="cividis_r",
             limits=(0, float(np.nanmax(counts))), name="corners")  # fmt: skip
    ax.set(title="corners over the image", xlabel="u (px)", ylabel="v (px)")


def _distances(ax: Axes, data: ReportData, board_from_camera: np.ndarray) -> None:
    distance = distance_m(board_from_camera, data.views.board)
    frames, edges = np.histogram(distance[np.isfinite(distance)], bins=12)
    ax.bars(edges, frames.astype(np.float64), BLUE)
    ax.set(title="distances", xlabel="distance (m)", ylabel="frames")


def _tilts(ax: Axes, board_from_camera: np.ndarray) -> None:
    tilt = np.degrees(tilt_rad(board_from_camera))
    direction = tilt_direction_rad(board_from_camera)
    ax.plot(
        tilt * np.cos(direction),
        tilt * np.sin(direction),
        marker="o",
        linestyle="",
        color=BLUE,
        fillstyle="none",
    )
    limit = 1.1 * max(10.0, float(np.nanmax(tilt)))
    for ring in (10, 20, 30, 45, 60):
        if ring < limit:
            turn = np.linspace(0, 2 * np.pi, 90)
            ax.plot(ring * np.cos(turn), ring * np.sin(turn), color="#c6cbd2", linewidth=0.7)
            ax.annotate(f"{ring}°", 0, ring, size=7, color="#5b616b", anchor="middle")
    ax.set(title="tilts", aspect="box", xlim=(-limit, limit), ylim=(-limit, limit),
           xlabel="along x (°)", ylabel="along y (°)")  # fmt: skip
