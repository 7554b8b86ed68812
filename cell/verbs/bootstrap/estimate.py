"""What is known of the cell so far, and where the board will be seen from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.roughly_known import (
    GuessSigma,
    fit_roughly_known,
    guess_from_one_view,
    with_sigma,
)
from calib.chain import rigid
from calib.chain.model import CellModel, evaluate, predict
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views
from cell.sequencer.bodies import outline_m
from cell.storage.files.parts import Box

SIGMAS = 3.0
_EDGE = 0.02
_CAMERA_BODY_M = 0.1
_BOARD_BODY_M = 0.03


@dataclass(frozen=True)
class Knowledge:
    """The fit of every view so far.

    Attributes
    ----------
    views, fit:
        The views, and what they and the layout say together.
    """

    views: Views
    fit: JointFit

    @classmethod
    def of(
        cls,
        views: Views,
        flange_from_mounted: FloatArray,
        alpha_px: float,
        prior_sigma: GuessSigma,
        *,
        refocuses: bool,
    ) -> Knowledge:
        """Fit; raises `CalibrationError` where the first view shows no plane."""
        guess = guess_from_one_view(views, flange_from_mounted, alpha_px, refocuses=refocuses)
        return cls(views, fit_roughly_known(views, guess, prior_sigma))

    @property
    def first_camera_from_board(self) -> FloatArray:
        """(4, 4) how the camera sees the board from where the arm stood first."""
        return np.asarray(
            evaluate(self.fit.model, self.views.take(np.array([0]))).camera_from_board[0]
        )

    def flange_for_camera_pose(self, camera_from_board: FloatArray) -> FloatArray:
        """(4, 4) base_from_flange from which the camera should see the board so."""
        in_hand = self.views.mount == "eye_in_hand"
        loop = rigid.inverse(camera_from_board) if in_hand else camera_from_board
        model = self.fit.model
        return np.asarray(model.base_from_fixed @ loop @ rigid.inverse(model.flange_from_mounted))

    def whole_board_visible(self, base_from_flange: FloatArray) -> bool:
        """Whether every corner, and a square around, is in the picture by three sigmas."""
        views = self._at(base_from_flange)

        def seen(model: CellModel) -> FloatArray:
            state = evaluate(model, views)
            depth = state.camera_from_board[:, 2, :3] @ state.points_m.T
            depth = depth + state.camera_from_board[:, 2, 3:]
            return np.asarray(np.concatenate([predict(model, views), depth[..., None]], axis=2)[0])

        value, sigma = with_sigma(self.fit, seen)
        depth_m, alpha_px = value[:, 2:], self.fit.model.optics[0]
        square_px = alpha_px * views.board.square_m / np.maximum(depth_m, 1e-3)
        margin = SIGMAS * sigma[:, :2] + square_px
        low, high = value[:, :2] - margin, value[:, :2] + margin
        size = np.array([views.width_px, views.height_px])
        inside = (low > _EDGE * size) & (high < (1.0 - _EDGE) * size)
        return bool(inside.all() and (depth_m > SIGMAS * sigma[:, 2:]).all())

    def fixed_box(self) -> Box:
        """Where the board (or the camera that stands) may be, by three sigmas."""
        in_hand = self.views.mount == "eye_in_hand"
        body = outline_m(self.views.board) if in_hand else np.zeros((1, 3))

        def place(model: CellModel) -> FloatArray:
            fixed = model.base_from_fixed
            return np.asarray(body @ fixed[:3, :3].T + fixed[:3, 3])

        value, sigma = with_sigma(self.fit, place)
        margin = SIGMAS * sigma + (_BOARD_BODY_M if in_hand else _CAMERA_BODY_M)
        low, high = (value - margin).min(axis=0), (value + margin).max(axis=0)
        name = "the board, as far as it is known" if in_hand else "the camera, as far as known"
        return Box(name=name, low_m=tuple(low.tolist()), high_m=tuple(high.tolist()))

    def _at(self, base_from_flange: FloatArray) -> Views:
        blank = Views.blank(
            self.views.board,
            width_px=self.views.width_px,
            height_px=self.views.height_px,
            frames=1,
            mount=self.views.mount,
        )
        return replace(blank, base_from_flange=base_from_flange[None])
