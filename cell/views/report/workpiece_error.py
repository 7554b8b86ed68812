"""How far from its true place the arm would meet a part that one picture located."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.views import FloatArray
from cell.views.report.data import ReportData
from cell.views.report.geometry import best_poses, distance_m, reference, workpiece_error_m


@dataclass(frozen=True)
class WorkpieceError:
    """One solution's error at the work piece, for the N views where it is known.

    Attributes
    ----------
    distance_m, error_m:
        (N,) depth of the board's centre, and RMS error of a part of the board's size located in
        that one picture, metres.
    against:
        As text, what it was measured against.
    """

    distance_m: FloatArray
    error_m: FloatArray
    against: str

    @property
    def rms_m(self) -> float:
        """RMS over the views, metres."""
        return float(np.sqrt((self.error_m**2).mean()))

    @property
    def p95_m(self) -> float:
        """The value 95 % of the views stay below, metres."""
        return float(np.quantile(self.error_m, 0.95))


def of_solution(data: ReportData, name: str) -> WorkpieceError | None:
    """The error at the work piece of solution `name`, or None without a reference."""
    poses = data.poses.get(name)
    if poses is None:
        return None
    true, against = reference(data, poses)
    if true is None:
        return None
    board = data.views.board
    error = workpiece_error_m(poses.board_from_camera, true, board)
    distance = distance_m(true, board)
    known = np.isfinite(error) & np.isfinite(distance)
    return WorkpieceError(distance[known], error[known], against) if known.any() else None


def corrected(data: ReportData) -> WorkpieceError | None:
    """The error at the work piece when all that the diagnosis found is put right, if measured.

    To first order: the corners move by the camera's remaining shift and turn.
    """
    found, poses = data.evidence, best_poses(data)
    if found is None or poses is None:
        return None
    if found.shift_after_m is None or found.turn_after_rad is None:
        return None
    board_from_camera = poses.board_from_camera
    at = data.views.board.corners_m - board_from_camera[:, None, :3, 3]
    in_camera = at @ board_from_camera[:, :3, :3]
    moved = found.shift_after_m[:, None] + np.cross(found.turn_after_rad[:, None], in_camera)
    error = np.sqrt((moved**2).sum(axis=2).mean(axis=1))
    distance = distance_m(board_from_camera, data.views.board)
    known = np.isfinite(error) & np.isfinite(distance)
    return WorkpieceError(distance[known], error[known], "the robot") if known.any() else None


def by_distance(found: WorkpieceError, bins: int = 4) -> list[tuple[float, float, int, float]]:
    """(from m, to m, frames, RMS m) over equal ranges of distance, empty ones left out."""
    edges = np.linspace(found.distance_m.min(), found.distance_m.max() + 1e-9, bins + 1)
    place = np.clip(np.digitize(found.distance_m, edges) - 1, 0, bins - 1)
    rows = []
    for k in range(bins):
        chosen = found.error_m[place == k]
        if len(chosen):
            rms = float(np.sqrt((chosen**2).mean()))
            rows.append((float(edges[k]), float(edges[k + 1]), len(chosen), rms))
    return rows
