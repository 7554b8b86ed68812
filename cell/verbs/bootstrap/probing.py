"""Where no layout is known: three small shifts show which way the mounted thing is turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.calibration.roughly_known import board_in_view
from calib.chain import rigid
from calib.chain.kinematics import OutOfReach
from calib.views import FloatArray, Views
from cell.devices.planned_camera import PlannedCamera
from cell.errors import BadAnswer, InputError
from cell.sequencer.guard import Guard
from cell.sequencer.guide import Guide
from cell.sequencer.same_arm import check_same_arm
from cell.sequencer.watcher import Checked
from cell.storage.files.cell_file import CellFile, Layout
from cell.storage.files.parts import Pose
from cell.storage.files.plan_file import View
from cell.verbs.bootstrap.guide import BootstrapGuide, view_of
from cell.verbs.bootstrap.layout_uncertainty import LayoutUncertainty
from cell.verbs.bootstrap.near_guard import NearGuard
from cell.verbs.bootstrap.visibility import Seen
from drivers.errors import SafetyError

_LARGEST_M, _SMALLEST_M = 0.02, 0.006
_EDGE = 0.02
_DOUBT_OF_ALPHA = 1.3
_DISTANCES = (0.75, 1.4)
"""Of the distance seen: what a plan is made for, where nobody states it."""
_AGREES = 0.25


class ProbingGuide(Guide):
    """Shifts the flange along its own axes, then goes on as a `BootstrapGuide`.

    Parameters
    ----------
    cell:
        Without a layout.
    guard, uncertainty:
        As for `BootstrapGuide`.
    """

    def __init__(self, cell: CellFile, guard: NearGuard, uncertainty: LayoutUncertainty) -> None:
        self.then: BootstrapGuide | None = None
        self._cell, self._guard, self._uncertainty = cell, guard, uncertainty
        self._frames: list[Checked] = []
        self._shifts: list[FloatArray] = []

    @property
    def guard(self) -> Guard:
        """Of every move."""
        return self._guard

    def checked(self, checked: Checked) -> None:
        """Keep a good frame until the next view is asked for."""
        if self.then is not None:
            self.then.checked(checked)
        elif checked.record is not None and checked.verdict.detection is not None:
            self._frames.append(checked)

    def next_view(self) -> View | None:
        """A shift that keeps the board in sight whichever way the camera looks, or what follows.

        Raises
        ------
        BadAnswer, InputError, SafetyError
            The board got out of sight, is too near to the edge, or does not move as it should; a
            shift is refused.
        """
        if self.then is not None:
            return self.then.next_view()
        if len(self._frames) != len(self._shifts) + 1:
            raise BadAnswer(
                "the board got out of sight as the arm was shifted by"
                f" {1e3 * float(np.linalg.norm(self._shifts[-1])):.0f} mm: start with it in the"
                " middle of the picture"
            )
        check_same_arm(self._guard.kinematics, self._frames[-1].shot.state)
        views = self._views()
        if len(self._shifts) < len("xyz"):
            return self._shift(views)
        layout = self._layout(views)
        cell = self._cell.model_copy(update={"layout": layout})
        uncertainty = replace(self._uncertainty, mount_m=self._uncertainty.reach_m)
        self.then = BootstrapGuide(cell, layout, self._guard, uncertainty)
        for frame in self._frames:
            self.then.checked(frame)
        return self.then.next_view()

    def _views(self) -> Views:
        seen = Seen(self._cell)
        for frame in self._frames:
            assert frame.verdict.detection is not None
            seen.add(frame.shot, frame.verdict.detection)
        assert seen.views is not None
        return seen.views

    def _shift(self, views: Views) -> View:
        """The flange shifted along its next axis, as far as the picture's edge surely allows."""
        axis = len(self._shifts)
        size_m = min(_LARGEST_M, self._room_m(views))
        if size_m < _SMALLEST_M:
            raise BadAnswer(
                f"the board is so near to the picture's edge that a shift of"
                f" {1e3 * _SMALLEST_M:.0f} mm might lose it: bring it to the middle of the picture"
            )
        name = f"shifted along the flange's {'xyz'[axis]}"
        refusal = None
        for shift in (size_m * np.eye(3)[axis], -size_m * np.eye(3)[axis]):
            pose = views.base_from_flange[0] @ rigid.compose(np.zeros(3), shift)
            try:
                joints = self._allowed(pose, name)
            except SafetyError as refused:
                refusal = refused
                continue
            self._shifts.append(shift)
            return view_of(name, joints)
        raise refusal or SafetyError(name)

    def _allowed(self, pose: FloatArray, name: str) -> FloatArray:
        guard = self._guard
        here = np.array(self._frames[-1].shot.state.joints_rad)
        try:
            joints = guard.kinematics.inverse(pose, guard.start_rad)
        except OutOfReach as far:
            raise SafetyError(f"{name}: {far}") from None
        guard.check_move(here, joints, name)
        guard.check_move(joints, guard.start_rad, name)
        return joints

    def _room_m(self, views: Views) -> float:
        """How far the camera may shift in any direction with the board still whole."""
        corners = views.corners_px[0][views.seen[0]]
        size = np.array([views.width_px, views.height_px])
        room_px = float(np.minimum(corners, size - corners).min() - _EDGE * size.max())
        alpha_px = PlannedCamera.of(self._cell).alpha_px
        distance_m = float(self._centres_m(views)[0, 2])
        return room_px * distance_m / (_DOUBT_OF_ALPHA * alpha_px)

    def _poses(self, views: Views) -> FloatArray:
        """(N, 4, 4) camera_from_board of each frame, by the lens as it is stated."""
        alpha_px = PlannedCamera.of(self._cell).alpha_px
        frames = (views.take(np.array([k])) for k in range(len(views)))
        return np.array([board_in_view(frame, alpha_px) for frame in frames])

    def _centres_m(self, views: Views) -> FloatArray:
        poses = self._poses(views)
        centre = views.board.corners_m.mean(axis=0)
        return np.asarray(poses[:, :3, :3] @ centre + poses[:, :3, 3])

    def _layout(self, views: Views) -> Layout:
        """What the shifts say: the rotation on the flange, and no more of the place than that."""
        first, centres = self._poses(views)[0], self._centres_m(views)
        moves, shifts = centres[1:] - centres[0], np.array(self._shifts)
        in_hand = views.mount == "eye_in_hand"
        turn, off_m = Rotation.align_vectors(shifts, -moves if in_hand else moves)
        if off_m > _AGREES * float(np.linalg.norm(shifts)):
            raise InputError(
                f"cell {self._cell.name}: the board does not move in the picture as the arm was"
                f" shifted ({1e3 * off_m:.0f} mm off). Check the mount (eye_in_hand or"
                " eye_to_hand), board.square_m and the lens, and that the board stands fast."
            )
        mounted = np.eye(4)
        mounted[:3, :3] = turn.as_matrix() @ (np.eye(3) if in_hand else first[:3, :3])
        loop = first if in_hand else rigid.inverse(first)
        fixed = views.base_from_flange[0] @ mounted @ loop
        near, far = (share * float(centres[0, 2]) for share in _DISTANCES)
        return Layout(
            mounted=Pose.of(RigidTransform.from_matrix(mounted)),
            fixed=Pose.of(RigidTransform.from_matrix(fixed)),
            home_deg=tuple(np.degrees(self._guard.start_rad).round(4).tolist()),
            distances_m=(round(near, 3), round(far, 3)),
        )
