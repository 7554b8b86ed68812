"""Every reading held against what the arm was ordered to do, on its way and where it stands.

A person who pushes it, a controller that takes another path, a stop that drifts, a pose that cannot
be: the arm stops, and the operator is informed.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.views import FloatArray
from cell.sequencer.guard import Guard
from drivers.arm import ArmState
from drivers.errors import SafetyError

CORRIDOR_RAD = 0.03
"""So far may a joint be from the straight way between two views: 1 to 3 cm at the flange."""
STANDING_RAD = 0.005
"""So far may it be from where the arm came to rest: 2 to 5 mm at the flange."""
ARRIVING_RAD = 0.02
_ON_PATH_RAD = 0.005
"""Nearer to the way, the guard's check of the way itself holds."""
_FASTER = 1.25
_STILL_RAD_S, _STILL_M_S = 0.05, 0.02
_WINDOW_S, _SHORTEST_S, _INSTANT_S = 0.3, 0.2, 1e-3
_UNCLOCKED_S, _UNCLOCKED_WINDOW_S = 0.8, 3.0
"""A reading without the controller's time may be so much older or newer than it seems: speeds are
then taken over a longer time."""
_TWITCH_RAD = 0.01
_POSE_M, _POSE_RAD = 0.015, float(np.radians(2.0))
"""So much may the pose shift against the model's: a calibrated arm and its maker's table differ."""
_POSE_EVERY_S, _POSE_EVERY_M = 0.04, 0.005
"""The pose is worked out from the joints so often; that takes longer than all the rest."""
_FROZEN_SHARE = 0.1


class ReadingWatch:
    """Raises `SafetyError` for a reading that cannot be, or must not be.

    Parameters
    ----------
    guard:
        The limits, boxes and speeds.
    """

    def __init__(self, guard: Guard) -> None:
        self._guard = guard
        self._recent: deque[ArmState] = deque()
        self._flange_off: RigidTransform | None = None
        self._posed: ArmState | None = None
        self._way: tuple[FloatArray, FloatArray] | None = None
        self._joint_speed_rad_s = np.full(6, np.inf)
        self._allowed_rad = np.inf
        self._moves = False

    def moves(self, here_rad: FloatArray, there_rad: FloatArray, joint_speed_rad_s: float) -> None:
        """The arm is ordered to move straight from (6,) joint angles to others, no joint faster."""
        self._way, self._moves, self._allowed_rad = (here_rad, there_rad), True, CORRIDOR_RAD
        travel = np.abs(there_rad - here_rad)
        self._joint_speed_rad_s = joint_speed_rad_s * travel / max(float(travel.max()), 1e-12)
        while len(self._recent) > 1:  # what the arm did on its way here was another move
            self._recent.popleft()

    def stands(self, where_rad: FloatArray, within_rad: float = STANDING_RAD) -> None:
        """The arm is to stand at (6,) joint angles."""
        self._way, self._moves, self._allowed_rad = (where_rad, where_rad), False, within_rad

    def check(self, state: ArmState) -> None:
        """Hold one reading against the way and the readings before it; the same one twice is none.

        Raises
        ------
        SafetyError
            What is wrong, as text for the operator.
        """
        if self._recent and state.host_t_s <= self._recent[-1].host_t_s:
            return
        joints = _finite_joints(state)
        if self._recent:
            self._check_jump(self._recent[-1], state, joints)
        if self._pose_is_due(state):
            self._check_pose(state, joints)
            self._posed = state
        self._remember(state)
        if self._way is not None:
            self._check_place(joints, *self._way)
            if self._moves:
                self._check_speed(state)

    def _remember(self, state: ArmState) -> None:
        self._recent.append(state)
        window_s = _UNCLOCKED_WINDOW_S if state.controller_t_s is None else _WINDOW_S
        while state.host_t_s - self._recent[0].host_t_s > window_s and len(self._recent) > 2:
            self._recent.popleft()

    def _check_jump(self, before: ArmState, state: ArmState, joints: FloatArray) -> None:
        elapsed_s = _elapsed_s(before, state)
        jumped = np.abs(joints - np.asarray(before.joints_rad))
        able = 1.1 * self._guard.kinematics.max_speed_rad_s * elapsed_s + _TWITCH_RAD
        if (jumped > able).any():
            joint = int(np.argmax(jumped - able))
            raise SafetyError(
                f"the arm's readings cannot be: joint {joint + 1} jumped by"
                f" {np.degrees(jumped[joint]):.1f}° within {elapsed_s:.3f} s, which it cannot."
                " They are not believed, and nothing moves on them."
            )

    def _pose_is_due(self, state: ArmState) -> bool:
        if self._posed is None or state.host_t_s - self._posed.host_t_s >= _POSE_EVERY_S:
            return True
        way = state.base_from_flange.translation - self._posed.base_from_flange.translation
        return not float(way @ way) < _POSE_EVERY_M**2

    def _check_pose(self, state: ArmState, joints: FloatArray) -> None:
        if not np.isfinite(state.base_from_flange.as_matrix()).all():
            raise SafetyError("the arm's pose is not finite; nothing moves on it")
        by_model = RigidTransform.from_matrix(self._guard.kinematics.forward(joints))
        off = by_model.inv() * state.base_from_flange
        if self._flange_off is None:
            self._flange_off = off
        shift = self._flange_off.inv() * off
        moved_m, turned_rad = float(np.linalg.norm(shift.translation)), shift.rotation.magnitude()
        slack_s = _UNCLOCKED_S if self._moves and state.controller_t_s is None else 0.0
        if (
            moved_m > _POSE_M + slack_s * self._guard.speed_m_s
            or turned_rad > _POSE_RAD + slack_s * self._guard.joint_speed_rad_s
        ):
            raise SafetyError(
                "the arm's readings cannot be: by its joint angles the flange is"
                f" {1e3 * moved_m:.0f} mm and {np.degrees(turned_rad):.1f}° from where the pose"
                " says. They are not believed, and nothing moves on them."
            )

    def _check_place(self, joints: FloatArray, here: FloatArray, there: FloatArray) -> None:
        travel = there - here
        length2 = float(travel @ travel)
        share = float(np.clip((joints - here) @ travel / length2, 0.0, 1.0)) if length2 else 0.0
        off = np.abs(joints - (here + share * travel))
        joint, off_rad = int(off.argmax()), float(off.max())
        if off_rad > self._allowed_rad:
            reported = f"joint {joint + 1} is {np.degrees(off_rad):.2f}°"
            if self._moves:
                raise SafetyError(
                    f"the arm left the way that was planned and checked: {reported} beside it. Look"
                    " what moves it: another program, a setting that blends moves, a person."
                )
            raise SafetyError(
                f"the arm was moved where it was to stand: {reported} from there. Look who or what"
                " moves it: a person, another program, a brake that slips."
            )
        if off_rad > _ON_PATH_RAD:
            self._guard.check_move(joints, joints, "the arm is not where it was ordered to be")

    def _check_speed(self, state: ArmState) -> None:
        reported = state.joint_velocity_rad_s
        if reported is not None:
            self._check_joint_speeds(np.abs(reported))
        first = self._recent[0]
        elapsed_s = _elapsed_s(first, state)
        if state.host_t_s - first.host_t_s < _SHORTEST_S:
            return
        way = state.base_from_flange.translation - first.base_from_flange.translation
        way_m, limit_m_s = float(np.linalg.norm(way)), self._guard.speed_m_s
        if way_m > (_FASTER * limit_m_s + _STILL_M_S) * elapsed_s:
            raise SafetyError(
                f"the flange moved {1e3 * way_m:.0f} mm within {elapsed_s:.2f} s, the plan allows"
                f" {limit_m_s:g} m/s"
            )
        # Robot Web Services report no speeds, and a controller may report the ordered ones
        turned = np.subtract(state.joints_rad or (), first.joints_rad or ())
        self._check_joint_speeds(np.abs(turned) / max(elapsed_s, _INSTANT_S))
        self._check_alive(first, state, elapsed_s)

    def _check_joint_speeds(self, speeds_rad_s: FloatArray) -> None:
        over = speeds_rad_s - (_FASTER * self._joint_speed_rad_s + _STILL_RAD_S)
        joint = int(over.argmax())
        if not over[joint] <= 0.0:
            raise SafetyError(
                f"joint {joint + 1} turns at {np.degrees(speeds_rad_s[joint]):.1f}°/s, its move"
                f" allows {np.degrees(self._joint_speed_rad_s[joint]):.1f}°/s"
            )

    def _check_alive(self, first: ArmState, state: ArmState, elapsed_s: float) -> None:
        """A speed that moves nothing is an old reading's."""
        speeds = [reading.joint_velocity_rad_s for reading in self._recent]
        reported = [speed for speed in speeds if speed is not None]
        if len(reported) < len(speeds):
            return
        slowest_rad_s = float(np.abs(reported).max(axis=1).min())
        turned = np.abs(np.subtract(state.joints_rad or (), first.joints_rad or ())).max()
        if (
            slowest_rad_s > _STILL_RAD_S
            and float(turned) < _FROZEN_SHARE * slowest_rad_s * elapsed_s
        ):
            raise SafetyError(
                f"the arm's readings cannot be: they report {slowest_rad_s:.2f} rad/s for"
                f" {elapsed_s:.2f} s and of no way. They are old, and nothing moves on them."
            )


def _finite_joints(state: ArmState) -> FloatArray:
    joints = np.asarray(state.joints_rad or (np.nan,), dtype=float)
    if not np.isfinite(joints).all():
        raise SafetyError("the arm's joint angles are not finite; nothing moves on them")
    return joints


def _elapsed_s(first: ArmState, last: ArmState) -> float:
    """The longest time that can have passed between two readings."""
    if first.controller_t_s is None or last.controller_t_s is None:
        return last.host_t_s - first.host_t_s + _UNCLOCKED_S
    return last.controller_t_s - first.controller_t_s
