"""Decides each move of a bootstrap from what the frames before it have shown."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from calib.chain.model import CellModel, evaluate
from calib.chain.optics import optics_row
from calib.detection import Detection
from calib.errors import CalibrationError
from calib.views import FloatArray
from cell.devices.planned_camera import PlannedCamera
from cell.errors import InputError
from cell.sequencer.guard import Guard
from cell.sequencer.guide import Guide
from cell.sequencer.same_arm import check_same_arm
from cell.sequencer.shot import Shot
from cell.sequencer.watcher import Checked
from cell.storage.files.cell_file import CellFile, Layout
from cell.storage.files.plan_file import View
from cell.verbs.bootstrap.estimate import Knowledge
from cell.verbs.bootstrap.layout_uncertainty import LayoutUncertainty
from cell.verbs.bootstrap.near_guard import NearGuard
from cell.verbs.bootstrap.plausible import check_moves, check_place
from cell.verbs.bootstrap.probing_views import (
    OFF_THE_MIDDLE_RAD,
    PROBING_VIEWS,
    SHARES,
    TO_THE_MIDDLE,
    off_the_middle_rad,
    towards_the_middle,
)
from cell.verbs.bootstrap.reach import Reach
from cell.verbs.bootstrap.visibility import Seen
from drivers.errors import SafetyError

_AFTER_A_LOSS = 0.6
"""Where the board got out of sight, every later move is so much smaller."""


class BootstrapGuide(Guide):
    """Views that keep the board in the picture and the arm near its start; see `Guide`.

    Parameters
    ----------
    cell:
        With the layout, as the file has it.
    guard:
        Of the whole bootstrap.
    uncertainty:
        How far the layout may be off.

    Attributes
    ----------
    layout:
        What was stated.
    knowledge:
        The fit of every frame so far, None before the first.
    refusal:
        Why the last move that was left out, or made smaller, was.
    """

    def __init__(
        self, cell: CellFile, layout: Layout, guard: NearGuard, uncertainty: LayoutUncertainty
    ) -> None:
        self._guard = guard
        self.knowledge: Knowledge | None = None
        self.refusal = ""
        self.layout = layout
        self._cell, self._uncertainty = cell, uncertainty
        self._centre_m = cell.board.board().corners_m.mean(axis=0)
        self._seen = Seen(cell)
        self._new: list[tuple[Shot, Detection]] = []
        self._remaining_views = list(PROBING_VIEWS)
        self._here = guard.start_rad
        self._middle: float | None = None
        self._lost = 0
        self._is_back = False

    @property
    def guard(self) -> Guard:
        """Of every move."""
        return self._guard

    def checked(self, checked: Checked) -> None:
        """Keep a good frame until the next view is asked for."""
        if checked.record is not None and checked.verdict.detection is not None:
            self._new.append((checked.shot, checked.verdict.detection))

    def next_view(self) -> View | None:
        """The next move that is sure to keep the board in sight; the start again at the end.

        Raises
        ------
        InputError
            The frames contradict the cell file.
        """
        self._learn()
        view = None if self.knowledge is None else self._next_view(self.knowledge)
        if view is None and not self._is_back:
            self._is_back = True
            view = view_of("back where it started", self._guard.start_rad)
        if view is not None:
            self._here = np.array(view.joints())
        return view

    def _learn(self) -> None:
        self._lost += not self._new
        for shot, detection in self._new:
            check_same_arm(self._guard.kinematics, shot.state)
            self._add(shot, detection)
            self._here = np.array(shot.state.joints_rad)
        self._new.clear()

    def _add(self, shot: Shot, detection: Detection) -> None:
        mounted = self.layout.mounted.transform().as_matrix()
        alpha_px = PlannedCamera.of(self._cell).alpha_px
        views = self._seen.add(shot, detection, self._model(mounted, alpha_px))
        refocuses = self._cell.camera.focus == "auto"
        try:
            known = Knowledge.of(
                views, mounted, alpha_px, self._uncertainty.prior_sigma, refocuses=refocuses
            )
        except CalibrationError as error:
            raise InputError(f"frame {shot.index}: {error}") from None
        if len(views) == 1:
            distance_m = float(evaluate(known.fit.model, views).distance_m[0])
            check_place(self._cell, self.layout, known.fit.model, distance_m, self._uncertainty)
        check_moves(self._cell, mounted, known.fit, self._uncertainty)
        self.knowledge = known

    def _model(self, mounted: FloatArray, alpha_px: float) -> CellModel:
        """The cell as far as it is known, to name a symmetric board's corners by."""
        if self.knowledge is not None:
            return self.knowledge.fit.model
        fixed = self.layout.fixed.transform().as_matrix()
        return CellModel(optics_row(alpha_px=alpha_px, beta_px=alpha_px), mounted, fixed)

    def _next_view(self, known: Knowledge) -> View | None:
        reach = Reach.of(known, self._guard, self._here)
        step_share = _AFTER_A_LOSS**self._lost
        first, centre = known.first_camera_from_board, self._centre_m
        if self._middle is None:
            self._middle = 0.0
            if off_the_middle_rad(first, centre) > OFF_THE_MIDDLE_RAD:
                way = partial(towards_the_middle, first, centre)
                self._middle, view = self._largest(TO_THE_MIDDLE, way, reach, step_share)
                if view is not None:
                    return view
        reference = towards_the_middle(first, centre, self._middle)
        for view_wanted in self._remaining_views:
            way = partial(view_wanted.camera_from_board, reference, centre)
            _, view = self._largest(view_wanted.name, way, reach, step_share)
            if view is not None:
                self._remaining_views.remove(view_wanted)  # others: when more is known
                return view
        return None

    def _largest(
        self, name: str, way: Callable[[float], FloatArray], reach: Reach, step_share: float
    ) -> tuple[float, View | None]:
        """The largest reachable share of a wanted view, and the view; 0, None where none."""
        for share in SHARES:
            try:
                joints = reach.joints(way(step_share * share), name)
            except SafetyError as refusal:
                self.refusal = str(refusal)
                continue
            return step_share * share, view_of(name, joints)
        return 0.0, None


def view_of(name: str, joints_rad: FloatArray) -> View:
    """A plan's view at (6,) joint angles."""
    return View(name=name, joints_rad=tuple(joints_rad.tolist()))
