"""What the newest packet and the child together say: at rest, arrived, or gone wrong."""

from __future__ import annotations

import time

import numpy as np

from drivers.ur.motion import MotionChild, MoveOrder, Phase
from drivers.ur.pose import transform_of
from drivers.ur.reader import Packet
from drivers.ur.runtime import Runtime

AT_REST_RAD_S = 0.01
_ARRIVED_RAD, _ARRIVED_M = 0.01, 0.002
_ACCEPT_S = 1.0
_PROGRAM_GRACE_S = 0.1


def at_rest(packet: Packet) -> bool:
    """Whether every joint stands, judged by the controller's own measured speeds."""
    return max(map(abs, packet.vector("actual_qd"))) < AT_REST_RAD_S


def missed(order: MoveOrder, packet: Packet) -> str | None:
    """Return how far from its target the motion ended, or None where it arrived."""
    if order.order == "move_j":
        off_rad = np.abs(np.subtract(packet.vector("actual_q"), order.target)).max()
        return f"the motion ended {off_rad:.3f} rad off" if off_rad > _ARRIVED_RAD else None
    off = transform_of(packet.vector("actual_TCP_pose")).inv() * transform_of(order.target)
    off_m, off_rad = float(np.linalg.norm(off.translation)), float(off.rotation.magnitude())
    if off_m > _ARRIVED_M or off_rad > _ARRIVED_RAD:
        return f"the motion ended {off_m * 1e3:.1f} mm and {off_rad:.3f} rad off"
    return None


class ProgramWatch:
    """Judges whether the child and the control script on the robot are both alive.

    Parameters
    ----------
    start_timeout_s:
        For the script to start.
    """

    def __init__(self, start_timeout_s: float) -> None:
        self._start_timeout_s = start_timeout_s
        self._playing_s = time.monotonic()

    def fault(self, child: MotionChild | None, packet: Packet) -> str | None:
        """Return what is wrong with either, or None."""
        runtime = Runtime(int(packet.number("runtime_state")))
        idle = child is None or child.phase is Phase.STARTING
        if idle or runtime is Runtime.PLAYING:
            self._playing_s = time.monotonic()
        if child is None:
            return None
        if child.phase is Phase.FAILED:
            return _gone(runtime) if child.was_ready and _ended(runtime) else child.why
        if child.phase is Phase.STARTING and child.in_phase_s > self._start_timeout_s:
            return "the control script did not start in time"
        if child.phase is Phase.ORDERED and child.in_phase_s > _ACCEPT_S:
            return "the controller did not take the motion in time"
        # the packet may be a few cycles older than what the child saw
        late = time.monotonic() - self._playing_s > _PROGRAM_GRACE_S
        return _gone(runtime) if late else None


def _ended(runtime: Runtime) -> bool:
    return runtime is not Runtime.PLAYING


def _gone(runtime: Runtime) -> str:
    return (
        f"the control program on the robot is {runtime.name.lower()}: somebody stopped it at the "
        "teach pendant, another client took its place, or the watchdog ended it, having heard "
        "nothing from here. Look at the pendant; check the network, and what else loads this "
        "computer"
    )
