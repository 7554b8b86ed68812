"""The protocol of an arm: a few non-blocking calls, polled by the one loop that owns it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from scipy.spatial.transform import RigidTransform


class Motion(Enum):
    """What the arm is doing, judged from its own state, never from elapsed time."""

    MOVING = "moving"
    STEADY = "steady"
    STOPPED_BY_FAULT = "stopped_by_fault"


@dataclass(frozen=True)
class ArmState:
    """One atomic reading of the controller.

    Attributes
    ----------
    host_t_s:
        Host clock (`time.monotonic` based) when the reading arrived, seconds.
    controller_t_s:
        The controller's own clock, seconds; None where it has none.
    joints_rad, joint_velocity_rad_s:
        Six joint angles and speeds; None where the controller does not report.
    base_from_flange:
        Pose of the tool flange in the robot base, never of the TCP.
    motion:
        See `Motion`.
    fault:
        None, or what stopped the arm, as text for the operator.
    raw:
        Values as the controller sent them, for the log.
    """

    host_t_s: float
    controller_t_s: float | None
    joints_rad: tuple[float, ...] | None
    joint_velocity_rad_s: tuple[float, ...] | None
    base_from_flange: RigidTransform
    motion: Motion
    fault: str | None = None
    raw: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class MoveTarget:
    """Where to go: joint angles, or a flange pose in the robot base (exactly one of them).

    `tcp_speed_m_s` bounds the flange's speed, `joint_speed_rad_s` every joint's.
    """

    joints_rad: tuple[float, ...] | None = None
    base_from_flange: RigidTransform | None = None
    tcp_speed_m_s: float = 0.1
    joint_speed_rad_s: float = 0.5


class Arm(Protocol):
    """A robot arm. No call but `connect` may block longer than 50 ms.

    What every driver raises stands here; a driver's own docstring adds only what is its maker's.
    """

    tried_on_hardware: bool

    def connect(self) -> None:
        """Open every link and check that the arm may be driven.

        A link from before is closed first. Nothing stays open where it fails.

        Raises
        ------
        DeviceUnreachable
            No answer.
        DeviceRefused
            The controller may not be driven from here, or runs a program of somebody else's.
        ArmStopped
            Powered off, or stopped for safety.
        """

    def state(self) -> ArmState:
        """The newest atomic reading; raises `DeviceUnreachable` when it is stale.

        Once the link was lost the arm has a fault until the next `connect`.
        """

    def start_move(self, target: MoveTarget) -> None:
        """Begin a move and return at once.

        Raises
        ------
        SafetyError
            It will not make this move; see `drivers.targets.check_target`.
        ArmStopped
            The arm has a fault.
        DeviceRefused
            It still moves.
        """

    def stop(self) -> None:
        """Stop now; returns once the order is out. Idempotent. Raises `StopFailed`."""

    def close(self) -> None:
        """Stop whatever moves and let go of the controller. Idempotent."""
