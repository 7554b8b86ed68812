"""Synchronised joint moves with trapezoidal speed, and how they brake."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from calib.chain.kinematics import ArmKinematics
from calib.views import FloatArray

_PATH_SAMPLES = 129
_SPEED_MARGIN = 0.99
"""The flange's speed is sampled along the path; what lies between samples stays within 1 %."""


class Profile(Protocol):
    """Share of the path covered, over time."""

    @property
    def duration_s(self) -> float:
        """Time until it stands."""

    def position(self, t_s: float) -> float:
        """Share of the path at that time."""

    def speed(self, t_s: float) -> float:
        """Change of it, 1/s."""


@dataclass(frozen=True)
class Trapezoid:
    """From 0 to 1: speed up, cruise, slow down (a triangle where there is no room to cruise).

    Attributes
    ----------
    cruise, acceleration:
        In shares of the path per second, and per second squared.
    """

    cruise: float
    acceleration: float

    @classmethod
    def of(cls, cruise: float, acceleration: float) -> Trapezoid:
        """The fastest profile within both bounds."""
        return cls(min(cruise, np.sqrt(acceleration)), acceleration)

    @property
    def ramp_s(self) -> float:
        """Time to reach cruising speed."""
        return self.cruise / self.acceleration

    @property
    def duration_s(self) -> float:
        """Time until it stands."""
        return 1.0 / self.cruise + self.ramp_s

    def position(self, t_s: float) -> float:
        """Share of the path at that time."""
        if t_s > self.duration_s / 2:
            return 1.0 - self.position(self.duration_s - t_s)
        t = max(t_s, 0.0)
        if t < self.ramp_s:
            return 0.5 * self.acceleration * t * t
        return self.cruise * (t - 0.5 * self.ramp_s)

    def speed(self, t_s: float) -> float:
        """Change of it, 1/s."""
        from_end = min(t_s, self.duration_s - t_s)
        return min(self.cruise, max(0.0, self.acceleration * from_end))


@dataclass(frozen=True)
class Brake:
    """From where it is to standstill at constant deceleration."""

    start: float
    start_speed: float
    deceleration: float

    @property
    def duration_s(self) -> float:
        """Time until it stands."""
        return self.start_speed / self.deceleration

    def position(self, t_s: float) -> float:
        """Share of the path at that time."""
        t = min(max(t_s, 0.0), self.duration_s)
        return self.start + self.start_speed * t - 0.5 * self.deceleration * t * t

    def speed(self, t_s: float) -> float:
        """Change of it, 1/s."""
        return max(0.0, self.start_speed - self.deceleration * max(t_s, 0.0))


@dataclass(frozen=True)
class Move:
    """A straight move in joint space.

    Attributes
    ----------
    start_rad, travel_rad:
        (6,) where it began, and the whole way.
    began_s:
        When, on the arm's clock.
    profile:
        How the way is covered.
    bulge_rad:
        (6,) how far from the straight way it leads, halfway.
    """

    start_rad: FloatArray
    travel_rad: FloatArray
    began_s: float
    profile: Profile
    bulge_rad: FloatArray | float = 0.0

    def joints(self, now_s: float) -> FloatArray:
        """(6,) joint angles."""
        share = self.profile.position(now_s - self.began_s)
        bulge = 4.0 * share * (1.0 - share) * self.bulge_rad
        return self.start_rad + self.travel_rad * share + bulge

    def speeds(self, now_s: float) -> FloatArray:
        """(6,) joint speeds."""
        elapsed_s = now_s - self.began_s
        share = self.profile.position(elapsed_s)
        way = self.travel_rad + 4.0 * (1.0 - 2.0 * share) * self.bulge_rad
        return way * self.profile.speed(elapsed_s)

    @property
    def ends_s(self) -> float:
        """When it stands."""
        return self.began_s + self.profile.duration_s

    def braked(self, now_s: float, deceleration_rad_s2: float) -> Move:
        """The move that this one becomes when it is stopped now."""
        elapsed = now_s - self.began_s
        rate = deceleration_rad_s2 / np.abs(self.travel_rad).max()
        brake = Brake(self.profile.position(elapsed), self.profile.speed(elapsed), rate)
        return replace(self, began_s=now_s, profile=brake)


def standing(joints_rad: FloatArray) -> Move:
    """The move of an arm that has stood at (6,) joint angles for ever."""
    return Move(joints_rad, np.zeros_like(joints_rad), -np.inf, Brake(0.0, 0.0, 1.0))


def plan_move(
    kinematics: ArmKinematics,
    start_rad: FloatArray,
    end_rad: FloatArray,
    began_s: float,
    *,
    flange_speed_m_s: float,
    joint_speed_rad_s: float,
    acceleration_rad_s2: float,
) -> Move:
    """The fastest trapezoidal move in which nothing exceeds its bound.

    Parameters
    ----------
    kinematics:
        The arm; its own joint speeds are bounds too.
    start_rad, end_rad:
        (6,) joint angles.
    began_s:
        When it starts.
    flange_speed_m_s, joint_speed_rad_s, acceleration_rad_s2:
        Bounds on the flange's origin, on every joint, and on every joint's acceleration.
    """
    travel = end_rad - start_rad
    widest = float(np.abs(travel).max())
    if widest == 0.0:
        return replace(standing(start_rad), began_s=began_s)
    share = np.linspace(0.0, 1.0, _PATH_SAMPLES)[:, None]
    jacobian = kinematics.jacobian(start_rad + share * travel)[:, :3]
    flange_m = float(np.linalg.norm(jacobian @ travel, axis=1).max())
    joint_bounds = np.minimum(joint_speed_rad_s, kinematics.max_speed_rad_s)
    cruise = min(
        float((joint_bounds / np.maximum(np.abs(travel), 1e-12)).min()),
        _SPEED_MARGIN * flange_speed_m_s / max(flange_m, 1e-12),
    )
    return Move(start_rad, travel, began_s, Trapezoid.of(cruise, acceleration_rad_s2 / widest))
