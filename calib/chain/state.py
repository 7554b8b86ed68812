"""The state that passes from link to link: where everything is while each frame is exposed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from calib.chain import rigid
from calib.chain.kinematics import ArmKinematics
from calib.chain.optics import COLUMN
from calib.chain.projection import project
from calib.views import FloatArray, Views

DOWN_IN_BASE = np.array([0.0, 0.0, -1.0])
"""Gravity's direction in the robot base: the base is taken to stand upright."""

_FIELD_STEPS = 8
"""A field changes by a few hundredths of a pixel over a pixel: each step gains two digits."""


@dataclass
class ChainState:
    """What the links have contributed so far about N frames.

    An effect may write into `optics`, `points_m` and `dh_offset`; every other array it replaces.

    Attributes
    ----------
    views:
        The log, read only.
    arm:
        The arm's kinematics, or None where the model is unknown.
    joints_rad:
        (N, J) where the joints truly are; clock and arm effects move them.
    dh_offset:
        (J, 5) corrections of the Denavit-Hartenberg rows, or None.
    base_from_flange:
        (N, 4, 4) where the flange truly is.
    flange_from_mounted, base_from_fixed:
        (N, 4, 4) the camera and the board for an eye in hand, the board and the camera else.
    points_m:
        (M, 3) the board's corners as they are.
    optics:
        (N, K) the lens and the sensor in each frame; nobody looks at it before the lens's turn.
    picture_fields:
        Each gives the (..., 2) pixels by which a corner seen at (..., 2) is displaced there.
    logged:
        What follows from the log and the arm alone, kept by `once`.
    """

    views: Views
    arm: ArmKinematics | None
    joints_rad: FloatArray
    base_from_flange: FloatArray
    flange_from_mounted: FloatArray
    base_from_fixed: FloatArray
    points_m: FloatArray
    optics: FloatArray
    dh_offset: FloatArray | None = None
    picture_fields: tuple[Callable[[FloatArray], FloatArray], ...] = ()
    camera_from_board: FloatArray = field(default_factory=lambda: np.empty((0, 4, 4)))
    logged: dict[str, FloatArray] = field(default_factory=dict)

    def copy(self) -> ChainState:
        """A state that goes on by itself from here."""
        return replace(
            self,
            optics=self.optics.copy(),
            points_m=self.points_m.copy(),
            dh_offset=None if self.dh_offset is None else self.dh_offset.copy(),
        )

    def once(self, name: str, work: Callable[[], FloatArray]) -> FloatArray:
        """Work out what follows from the log and the arm alone, once for all copies."""
        if name not in self.logged:
            self.logged[name] = work()
        return self.logged[name]

    @property
    def in_hand(self) -> bool:
        """True when the camera rides on the flange."""
        return self.views.mount == "eye_in_hand"

    def column(self, name: str) -> FloatArray:
        """Return a writable (N,) view of one optics column."""
        return self.optics[:, COLUMN[name]]

    @property
    def base_from_camera(self) -> FloatArray:
        """(N, 4, 4), valid from the mount link on."""
        if self.in_hand:
            return rigid.product(self.base_from_flange, self.flange_from_mounted)
        return self.base_from_fixed

    @property
    def base_from_board(self) -> FloatArray:
        """(N, 4, 4), valid from the board link on."""
        if self.in_hand:
            return self.base_from_fixed
        return rigid.product(self.base_from_flange, self.flange_from_mounted)

    def gravity_in_camera(self) -> FloatArray:
        """(N, 3) unit vectors of gravity as the camera feels it."""
        rotation = self.base_from_camera[:, :3, :3]
        return np.asarray(np.einsum("nji,j->ni", rotation, DOWN_IN_BASE))

    @property
    def distance_m(self) -> FloatArray:
        """(N,) depth of the board's centre along the optical axis."""
        centre = self.points_m.mean(axis=0)
        pose = self.camera_from_board
        return np.asarray(pose[:, 2, :3] @ centre + pose[:, 2, 3])

    @property
    def focused_m(self) -> FloatArray:
        """(N,) distance the lens is focused at: the logged one, or the board's where none is."""
        logged = self.views.focus_distance_m
        return np.where(np.isfinite(logged), logged, self.distance_m)

    def move_arm(self) -> None:
        """Bring the flange to where the moved joints and links put it.

        The logged pose is corrected by the difference that the effects make in the nominal
        kinematics, so that a controller's own factory calibration stays in it.
        """
        logged = self.views.joints_rad
        unmoved = self.joints_rad is logged or np.array_equal(self.joints_rad, logged)
        arm = self.arm
        if arm is None or (self.dh_offset is None and unmoved):
            return
        back = self.once("nominal_from_base", lambda: rigid.inverse(arm.forward(logged)))
        true = arm.forward(self.joints_rad, self.dh_offset)
        moved = rigid.product(self.base_from_flange, rigid.product(back, true))
        known = np.isfinite(moved).all(axis=(1, 2), keepdims=True)
        self.base_from_flange = np.where(known, moved, self.base_from_flange)

    def place(self) -> None:
        """Work out where the camera sees the board."""
        camera_from_base = rigid.inverse(self.base_from_camera)
        self.camera_from_board = rigid.product(camera_from_base, self.base_from_board)

    def straightened(self, seen_px: FloatArray) -> FloatArray:
        """(N, M, 2) where the lens alone would have shown what is seen at (N, M, 2) pixels."""
        displaced = (field(seen_px) for field in self.picture_fields)
        return np.asarray(seen_px - sum(displaced)) if self.picture_fields else seen_px

    def pixels(self) -> FloatArray:
        """(N, M, 2) where the corners are seen."""
        ideal = project(self.optics, self.camera_from_board, self.points_m)
        seen = ideal
        for _ in range(_FIELD_STEPS if self.picture_fields else 0):
            seen = ideal + seen - self.straightened(seen)
        return seen

    def pose_by_flange(self) -> FloatArray:
        """(N, 6, 6) increment of camera_from_board for a small increment of the flange."""
        if self.in_hand:
            return -rigid.adjoint(rigid.inverse(self.flange_from_mounted))
        return rigid.adjoint(
            rigid.product(rigid.inverse(self.base_from_fixed), self.base_from_flange)
        )

    def board_velocity(self) -> FloatArray:
        """(N, 6) of the board in the camera's frame, m/s and rad/s; zero where not known."""
        if self.arm is None:
            return np.zeros((len(self.views), 6))
        speed = self.views.joint_velocity_rad_s[..., None]
        flange = self.arm.flange_jacobian(self.joints_rad, self.dh_offset) @ speed
        return np.nan_to_num((self.pose_by_flange() @ flange)[..., 0])
