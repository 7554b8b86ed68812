"""A simulated arm: the maker's kinematics, trapezoidal moves, scatter, faults on command."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import ArmKinematics, OutOfReach
from calib.views import FloatArray
from drivers.arm import ArmState, Motion, MoveTarget
from drivers.errors import ArmStopped, DeviceRefused, DeviceUnreachable, SafetyError, StopFailed
from drivers.targets import check_target
from sim.clock import Clock
from sim.motion import Move, Trapezoid, plan_move, standing
from sim.noise import PlacedNoise

ACCELERATION_RAD_S2 = 1.4
"""Universal Robots' default for `movej`."""
DECELERATION_RAD_S2 = 4.0
MAX_JOINT_SPEED_RAD_S, MAX_TCP_SPEED_M_S = 10.0, 10.0
"""No arm of this class is as fast: a target that asks for more is a mistake of units."""
SETTLE_S = 0.15
"""The arm calls itself steady this long after the last joint has stopped."""


@dataclass
class ArmFaults:
    """What tests and demonstrations let go wrong.

    Attributes
    ----------
    protective_stop_at_move:
        The move with this number (from 1) ends in a protective stop halfway.
    unreachable:
        The link is dead: every call raises `DeviceUnreachable`.
    stop_fails:
        `stop` raises `StopFailed` and the arm goes on.
    brakes_slip:
        What moves it goes on, whoever brakes.
    speed_factor:
        Moves are so many times as fast as they were ordered.
    bulge_rad:
        Joint 3 is so far from the straight way, halfway along a move.
    """

    protective_stop_at_move: int | None = None
    unreachable: bool = False
    stop_fails: bool = False
    brakes_slip: bool = False
    speed_factor: float = 1.0
    bulge_rad: float = 0.0


@dataclass(frozen=True)
class ArmTruth:
    """What the world knows of the arm and its controller does not report.

    Attributes
    ----------
    joints_rad, joint_velocity_rad_s, approach_joints_rad:
        (6,) as the controller has them; `approach` is where the last move began.
    flange_error:
        (6,) by how much the flange misses the reported pose, in its own frame: metres, radians.
    """

    joints_rad: FloatArray
    joint_velocity_rad_s: FloatArray
    approach_joints_rad: FloatArray
    flange_error: FloatArray


@dataclass(frozen=True)
class Repeatability:
    """Scatter of the true flange around the reported one, one sigma per axis, drawn per move."""

    position_m: float = 0.0
    rotation_rad: float = 0.0

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...] = ()) -> FloatArray:
        """(..., 6) flange errors."""
        sigma = np.repeat([self.position_m, self.rotation_rad], 3)
        return np.asarray(sigma * rng.standard_normal((*shape, 6)))


class SimArm:
    """An arm in this process; see `drivers.arm.Arm`.

    Parameters
    ----------
    kinematics, clock:
        Which arm, and the time it lives in.
    home_rad:
        (6,) joint angles it stands at first.
    repeatability, noise:
        How it scatters, and by which random numbers.
    """

    tried_on_hardware = False

    def __init__(
        self,
        kinematics: ArmKinematics,
        clock: Clock,
        home_rad: FloatArray,
        *,
        repeatability: Repeatability | None = None,
        noise: PlacedNoise | None = None,
    ) -> None:
        self.faults = ArmFaults()
        self.moves_made = 0
        self._kinematics = kinematics
        self._clock = clock
        self._repeatability = repeatability or Repeatability()
        self._noise = noise or PlacedNoise(0, 0)
        self._lock = threading.RLock()
        self._connected = False
        self._fault: str | None = None
        self._fault_due_s = np.inf
        self._flange_error = np.zeros(6)
        self._move = standing(np.asarray(home_rad, float))

    # -- the protocol ------------------------------------------------------------------------

    def connect(self) -> None:
        """Open the link; raises `DeviceUnreachable` or, after a fault, `DeviceRefused`."""
        self._check_link(connected=True)
        if self._fault is not None:
            raise DeviceRefused(f"simulated arm: {self._fault}; clear the fault first")
        self._connected = True

    def state(self) -> ArmState:
        """The newest reading; raises `DeviceUnreachable` where the link is dead."""
        with self._lock:
            self._check_link(self._connected)
            now = self._advance()
            joints, speeds = self._move.joints(now), self._move.speeds(now)
            pose = RigidTransform.from_matrix(self._kinematics.forward(joints))
            return ArmState(
                host_t_s=now,
                controller_t_s=now,
                joints_rad=tuple(joints.tolist()),
                joint_velocity_rad_s=tuple(speeds.tolist()),
                base_from_flange=pose,
                motion=self._motion(now),
                fault=self._fault,
            )

    def start_move(self, target: MoveTarget) -> None:
        """Begin a move.

        Raises
        ------
        SafetyError
            Out of reach, outside the joint limits, or without a positive speed.
        ArmStopped, DeviceRefused, DeviceUnreachable
            A fault is standing; it is still moving; the link is dead.
        """
        with self._lock:
            self._check_link(self._connected)
            now = self._advance()
            if self._fault is not None:
                raise ArmStopped(f"simulated arm: {self._fault}; clear the fault first")
            if now < self._move.ends_s:
                raise DeviceRefused("simulated arm: it is still moving; stop it or wait")
            start = self._move.joints(now)
            self._move = self._planned(target, start, now)
            self._flange_error = self._scatter(start, start + self._move.travel_rad)
            self.moves_made += 1
            if self.faults.protective_stop_at_move == self.moves_made:
                self._fault_due_s = now + 0.5 * self._move.profile.duration_s

    def stop(self) -> None:
        """Brake; raises `StopFailed` where that was asked for."""
        with self._lock:
            if self.faults.stop_fails:
                raise StopFailed("simulated arm: the controller does not confirm the stop")
            if self.faults.unreachable:
                raise StopFailed("simulated arm: the stop could not be sent, the link is dead")
            self._brake(self._advance())

    def close(self) -> None:
        """Stop and let go."""
        with self._lock:
            self._brake(self._advance())
            self._connected = False

    # -- the world's side --------------------------------------------------------------------

    def truth(self) -> ArmTruth:
        """Where the arm is now, for the simulated camera."""
        with self._lock:
            now = self._advance()
            return ArmTruth(
                self._move.joints(now),
                self._move.speeds(now),
                self._move.start_rad,
                self._flange_error,
            )

    def protective_stop(self, reason: str = "protective stop") -> None:
        """Let the controller stop the arm by itself, as a collision would."""
        with self._lock:
            self._brake(self._advance())
            self._fault = reason

    def push(self, by_rad: FloatArray, speed_rad_s: float) -> None:
        """Turn the joints by (6,) angles without an order: a person, a load that sags."""
        with self._lock:
            now = self._advance()
            by = np.asarray(by_rad, float)
            widest = float(np.abs(by).max())
            profile = Trapezoid.of(speed_rad_s / widest, ACCELERATION_RAD_S2 / widest)
            self._move = Move(self._move.joints(now), by, now, profile)

    def clear_fault(self) -> None:
        """What an operator does at the pendant after a protective stop."""
        with self._lock:
            self._fault = None

    def has_moved(self, came_from_rad: FloatArray, joints_rad: FloatArray) -> FloatArray:
        """Stand where an interrupted run's move ended; returns the (6,) flange's error there."""
        with self._lock:
            self._move = standing(np.asarray(joints_rad, float))
            self._flange_error = self._scatter(came_from_rad, joints_rad)
            return self._flange_error

    # -- inside ------------------------------------------------------------------------------

    def _scatter(self, start: FloatArray, end: FloatArray) -> FloatArray:
        return self._repeatability.draw(self._noise.at(start, end))

    def _planned(self, target: MoveTarget, start: FloatArray, now: float) -> Move:
        check_target(
            target,
            max_joint_speed_rad_s=MAX_JOINT_SPEED_RAD_S,
            max_tcp_speed_m_s=MAX_TCP_SPEED_M_S,
            joint_limits_rad=[(low, high) for low, high in self._kinematics.limits_rad],
        )
        move = plan_move(
            self._kinematics,
            start,
            self._goal(target, start),
            now,
            flange_speed_m_s=target.tcp_speed_m_s * self.faults.speed_factor,
            joint_speed_rad_s=target.joint_speed_rad_s * self.faults.speed_factor,
            acceleration_rad_s2=ACCELERATION_RAD_S2,
        )
        return replace(move, bulge_rad=self.faults.bulge_rad * np.eye(6)[2])

    def _goal(self, target: MoveTarget, start: FloatArray) -> FloatArray:
        if target.base_from_flange is not None:
            try:
                return self._kinematics.inverse(target.base_from_flange.as_matrix(), start)
            except OutOfReach as far:
                raise SafetyError(f"simulated arm: {far}") from None
        return np.asarray(target.joints_rad, float)

    def _advance(self) -> float:
        """Now; on the way, a protective stop that has fallen due happens at its own time."""
        now = self._clock.now()
        if now >= self._fault_due_s:
            self._brake(self._fault_due_s)
            self._fault = "protective stop"
        return now

    def _brake(self, now: float) -> None:
        if now < self._move.ends_s and not self.faults.brakes_slip:
            self._move = self._move.braked(now, DECELERATION_RAD_S2)
            self._fault_due_s = np.inf

    def _motion(self, now: float) -> Motion:
        if self._fault is not None:
            return Motion.STOPPED_BY_FAULT
        return Motion.MOVING if now < self._move.ends_s + SETTLE_S else Motion.STEADY

    def _check_link(self, connected: bool) -> None:
        if self.faults.unreachable:
            raise DeviceUnreachable("simulated arm: the link is dead")
        if not connected:
            raise DeviceUnreachable("simulated arm: not connected; call connect() first")
