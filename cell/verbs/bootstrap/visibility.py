"""The frames of a bootstrap as views, their corners named alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from calib.calibration.roughly_known import guess_from_one_view
from calib.chain.model import CellModel, predict
from calib.detection import Detection
from calib.detection.orientation import possible_turns, turned_order
from calib.views import FloatArray, Views
from cell.sequencer.shot import Shot
from cell.storage.files.cell_file import CellFile

Known = TypeVar("Known")


@dataclass
class Seen:
    """Frames in the order they came.

    Attributes
    ----------
    cell:
        Whose board and camera they show.
    views:
        None before the first.
    """

    cell: CellFile
    views: Views | None = field(default=None, init=False)

    def add(self, shot: Shot, detection: Detection, model: CellModel | None = None) -> Views:
        """All views, this frame the last.

        The corners of a symmetric board are named as `model` sees them, and without one as they
        lay in the frame before.
        """
        view = self._view(shot, detection)
        if model is not None:
            view = _named_as(view, _turned_rad if self.views is None else _missed_px, model)
        elif self.views is not None:
            view = _named_as(view, _moved_px, self.views)
        self.views = view if self.views is None else self.views.joined(view)
        return self.views

    def _view(self, shot: Shot, detection: Detection) -> Views:
        camera, state = self.cell.camera, shot.state
        focus_m = shot.frame.focus_distance_m
        view = Views.from_corners(
            self.cell.board.board(),
            detection.corners_px[None],
            image_size_px=(camera.width, camera.height),
            base_from_flange=state.base_from_flange.as_matrix()[None],
            mount=self.cell.mount,
            robot_model=self.cell.robot.model,
            joints_rad=np.array([state.joints_rad]),
            focus_distance_m=np.array([np.nan if focus_m is None else focus_m]),
        )
        return replace(view, frame=np.array([shot.index]))


def _named_as(view: Views, misfit: Callable[[Views, Known], float], known: Known) -> Views:
    ways = [view.corners_px[:, turned_order(view.board, t)] for t in possible_turns(view.board)]
    return min(
        (replace(view, corners_px=corners) for corners in ways), key=lambda one: misfit(one, known)
    )


def _moved_px(view: Views, before: Views) -> float:
    return float(np.nanmean(np.linalg.norm(view.corners_px - before.corners_px[-1], axis=2)))


def _turned_rad(view: Views, model: CellModel) -> float:
    """By how much the view turns the fixed part against the model."""
    mounted, alpha_px = model.flange_from_mounted, float(model.optics[0])
    seen = guess_from_one_view(view, mounted, alpha_px, refocuses=False).base_from_fixed
    return _angle_rad(seen[:3, :3].T @ model.base_from_fixed[:3, :3])


def _missed_px(view: Views, model: CellModel) -> float:
    return float(np.nanmean(np.linalg.norm(view.corners_px - predict(model, view), axis=2)))


def _angle_rad(rotation: FloatArray) -> float:
    return float(np.arccos(np.clip(0.5 * (np.trace(rotation) - 1.0), -1.0, 1.0)))
