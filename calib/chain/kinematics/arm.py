"""One arm's kinematics behind one small interface, whatever its geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from calib.chain.kinematics import dh as chain
from calib.chain.kinematics.gravity import (
    STANDARD_GRAVITY_M_S2,
    LinkMasses,
    base_moment,
    gravity_torques,
)
from calib.views import BoolArray, FloatArray

InverseBranches = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""(dh, base_from_flange, joints to take where a singular pose leaves them free) -> (B, 6)."""

_POSE_TOLERANCE = 1e-7


class OutOfReach(ValueError):
    """No joint angles within the arm's limits put the flange at the pose asked for."""


@dataclass(frozen=True)
class ArmKinematics:
    """Nominal kinematics of a six-joint arm.

    Attributes
    ----------
    name:
        Model name, lower case.
    dh:
        (6, 5) rows (theta offset rad, d m, a m, alpha rad, beta rad), see `dh`; the last link is
        the flange.
    limits_rad:
        (6, 2) lower and upper joint limits.
    max_speed_rad_s:
        (6,) greatest joint speeds.
    reach_m:
        The maker's figure for how far the wrist gets from joint 1's axis.
    masses:
        Link masses and centres of mass, for `gravity_torques`.
    ends:
        (2, 4, 4) base_from_first and last_from_flange, before and behind the rows.
    """

    name: str
    dh: FloatArray
    limits_rad: FloatArray
    max_speed_rad_s: FloatArray
    reach_m: float
    masses: LinkMasses
    inverse_branches: InverseBranches = field(repr=False)
    ends: FloatArray = field(default_factory=lambda: np.array([np.eye(4), np.eye(4)]))

    def forward(self, joints_rad: FloatArray, dh_offset: FloatArray | None = None) -> FloatArray:
        """Flange poses in the base frame.

        Parameters
        ----------
        joints_rad:
            (..., 6) joint angles, radians.
        dh_offset:
            (6, 5) or (..., 6, 5) to be added to `dh`: a calibrated or a wrong geometry.

        Returns
        -------
        FloatArray
            (..., 4, 4) base_from_flange.
        """
        tips = chain.tips(np.asarray(joints_rad, float), self._rows(dh_offset))
        return tips if self._bare else np.asarray(self.ends[0] @ tips @ self.ends[1])

    def frames(self, joints_rad: FloatArray, dh_offset: FloatArray | None = None) -> FloatArray:
        """Poses (..., 7, 4, 4) in the base of the base frame and the six link frames."""
        frames = chain.frames(np.asarray(joints_rad, float), self._rows(dh_offset))
        if not self._bare:
            frames = self.ends[0] @ frames
            frames[..., -1, :, :] = frames[..., -1, :, :] @ self.ends[1]
        return frames

    @cached_property
    def _bare(self) -> bool:
        """Whether base and flange are the chain's own first and last frame."""
        return bool((self.ends == np.eye(4)).all())

    def jacobian(self, joints_rad: FloatArray, dh_offset: FloatArray | None = None) -> FloatArray:
        """Geometric Jacobian (..., 6, 6) in the base frame.

        Rows 0-2 are the flange origin's velocity in m/rad, rows 3-5 the flange's angular
        velocity in rad/rad, one column a joint.
        """
        poses = self.frames(joints_rad, dh_offset)
        axes = poses[..., :6, :3, 2]
        arms = poses[..., 6:7, :3, 3] - poses[..., :6, :3, 3]
        stacked = np.concatenate([np.cross(axes, arms), axes], axis=-1)
        return np.swapaxes(stacked, -1, -2)

    def flange_jacobian(
        self, joints_rad: FloatArray, dh_offset: FloatArray | None = None
    ) -> FloatArray:
        """`jacobian` (..., 6, 6) in the flange's own frame."""
        to_flange = np.swapaxes(self.forward(joints_rad, dh_offset)[..., :3, :3], -1, -2)
        jacobian = self.jacobian(joints_rad, dh_offset)
        return np.concatenate(
            [to_flange @ jacobian[..., :3, :], to_flange @ jacobian[..., 3:, :]], -2
        )

    def inverse_all(
        self, base_from_flange: FloatArray, near_rad: FloatArray | None = None
    ) -> FloatArray:
        """Every branch that reaches a pose within the joint limits.

        Parameters
        ----------
        base_from_flange:
            (4, 4) pose asked for.
        near_rad:
            (6,) where given, each joint takes the turn (2 pi equivalent) nearest to it;
            otherwise the one nearest to zero. It also fixes a wrist joint that a singular
            pose leaves free.

        Returns
        -------
        FloatArray
            (B, 6), B from 0 to 8, nearest first.
        """
        near = np.zeros(6) if near_rad is None else np.asarray(near_rad, float)
        raw = self.inverse_branches(self.dh, base_from_flange, near)
        branches = self._nearest_turns(raw, near)
        branches = branches[np.isfinite(branches).all(axis=1)]
        misfit = np.abs(self.forward(branches) - base_from_flange).max(axis=(1, 2), initial=0.0)
        branches = branches[misfit < _POSE_TOLERANCE]
        order = np.argsort(np.linalg.norm(branches - near, axis=1), kind="stable")
        return np.asarray(branches[order])

    def inverse(self, base_from_flange: FloatArray, near_rad: FloatArray) -> FloatArray:
        """The branch (6,) nearest to `near_rad`; raises `OutOfReach` where there is none."""
        branches = self.inverse_all(base_from_flange, near_rad)
        if len(branches) == 0:
            x, y, z = base_from_flange[:3, 3]
            raise OutOfReach(
                f"{self.name} cannot put its flange at x={x:.3f} y={y:.3f} z={z:.3f} m in that "
                f"orientation within its joint limits (reach {self.reach_m} m): bring the target "
                "nearer, or turn it"
            )
        return np.asarray(branches[0])

    def within_limits(self, joints_rad: FloatArray) -> BoolArray:
        """Whether all six joints (..., 6) are within their limits: (...)."""
        joints = np.asarray(joints_rad, float)
        inside = (joints >= self.limits_rad[:, 0]) & (joints <= self.limits_rad[:, 1])
        return np.asarray(inside.all(axis=-1))

    def gravity_torques(
        self,
        joints_rad: FloatArray,
        payload_kg: float = 0.0,
        payload_com_m: FloatArray | tuple[float, float, float] = (0.0, 0.0, 0.0),
        gravity_m_s2: FloatArray | tuple[float, float, float] = STANDARD_GRAVITY_M_S2,
    ) -> FloatArray:
        """Torques (..., 6) in Nm that hold the arm still; see `gravity.gravity_torques`."""
        return gravity_torques(
            self.frames(joints_rad), self.masses, payload_kg, payload_com_m, gravity_m_s2
        )

    def base_moment(self, joints_rad: FloatArray, payload_kg: float = 0.0) -> FloatArray:
        """Moment (..., 3) in Nm of the arm's weight about its base; see `gravity.base_moment`."""
        return base_moment(self.frames(joints_rad), self.masses, payload_kg)

    def _rows(self, dh_offset: FloatArray | None) -> FloatArray:
        return self.dh if dh_offset is None else self.dh + dh_offset

    def _nearest_turns(self, joints_rad: FloatArray, near_rad: FloatArray) -> FloatArray:
        """Add whole turns towards `near_rad`, back inside the limits; NaN where none fits."""
        turn = 2 * np.pi
        angle = joints_rad + turn * np.round((near_rad - joints_rad) / turn)
        low, high = self.limits_rad[:, 0] - 1e-9, self.limits_rad[:, 1] + 1e-9
        angle = angle - turn * np.ceil((angle - high) / turn) * (angle > high)
        angle = angle + turn * np.ceil((low - angle) / turn) * (angle < low)
        return np.where((angle >= low) & (angle <= high), angle, np.nan)
