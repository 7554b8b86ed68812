"""What goes wrong with a simulated robot controller on command, whichever maker's it is."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from drivers.arm import Arm, ArmState, MoveTarget

_RESUMED_RAD = 0.3 * np.eye(6)[5]
_RESUMED_RAD_S = 0.1


class Stops(Enum):
    """What the controller makes of an order to stop.

    ``obeyed``; ``late``: taken, and obeyed `ControllerFaults.late_s` afterwards; ``ignored``:
    taken, and the arm drives on to its target; ``refused``: answered with a refusal; ``resumed``:
    obeyed, and `late_s` after its halt the arm goes on, once, until it is stopped again.
    """

    OBEYED = "obeyed"
    LATE = "late"
    IGNORED = "ignored"
    REFUSED = "refused"
    RESUMED = "resumed"


@dataclass
class ControllerFaults:
    """Faults that a test switches on and off while the controller runs.

    Attributes
    ----------
    stops, late_s:
        See `Stops`. They hold for orders from outside and for the controller's own watchdog;
        a protective stop, a guard or the red button stop the arm whatever these say.
    watchdog_fails:
        The controller's own watch over the link stops nothing.
    mute:
        Nothing goes out; no connection is closed.
    deaf:
        Nothing comes in.
    frozen_clock:
        The time stamp of the readings stays, their values go on.
    old_readings:
        Joints, speeds and pose stay as they were when this was switched on; the clock goes on.
    """

    stops: Stops = Stops.OBEYED
    late_s: float = 0.5
    watchdog_fails: bool = False
    mute: bool = False
    deaf: bool = False
    frozen_clock: bool = False
    old_readings: bool = False

    def cut(self) -> None:
        """Pull the network cable: nothing passes in either direction, no socket is closed."""
        self.mute = self.deaf = True

    def mend_cable(self) -> None:
        """Plug it in again."""
        self.mute = self.deaf = False


class StopOrders:
    """Carries out orders to stop as the faults have it.

    Parameters
    ----------
    faults:
        Asked anew for every order.
    arm:
        The arm that goes on without an order where the faults say so.
    halt:
        Stops it; called with the reason.
    note:
        Called with what was not obeyed.
    """

    def __init__(
        self,
        faults: Callable[[], ControllerFaults],
        arm: Arm,
        halt: Callable[[str], None],
        note: Callable[[str], None],
    ) -> None:
        self._faults, self._arm, self._halt, self._note = faults, arm, halt, note
        self._late: threading.Timer | None = None

    @property
    def refused(self) -> bool:
        """Whether the order is to be answered with a refusal."""
        return self._faults().stops is Stops.REFUSED

    def take(self, why: str) -> None:
        """Take an order that was not refused."""
        faults = self._faults()
        if faults.stops is Stops.IGNORED:
            self._note(f"stop ignored: {why}")
        elif faults.stops is Stops.LATE:
            self._once_in(faults.late_s, lambda: self._halt(why))
        else:
            self._halt(why)
        if faults.stops is Stops.RESUMED:
            faults.stops = Stops.OBEYED
            self._once_in(faults.late_s, self._resume)

    def _resume(self) -> None:
        joints = np.asarray(self._arm.state().joints_rad) + _RESUMED_RAD
        self._note("the arm goes on by itself")
        self._arm.start_move(
            MoveTarget(tuple(joints.tolist()), joint_speed_rad_s=_RESUMED_RAD_S, tcp_speed_m_s=1.0)
        )

    def _once_in(self, duration_s: float, act: Callable[[], None]) -> None:
        if self._late is None or not self._late.is_alive():
            self._late = threading.Timer(duration_s, act)
            self._late.daemon = True
            self._late.start()


class Reported:
    """The arm's state as the controller reports it.

    Parameters
    ----------
    state:
        Reads the arm.
    faults:
        Asked anew for every reading.
    """

    def __init__(
        self, state: Callable[[], ArmState], faults: Callable[[], ControllerFaults]
    ) -> None:
        self._state, self._faults = state, faults
        self._clock: ArmState | None = None
        self._values: ArmState | None = None

    def __call__(self) -> ArmState:
        """Return the newest reading, or what a fault makes of it."""
        live, faults = self._state(), self._faults()
        clock = self._clock if faults.frozen_clock and self._clock else live
        values = self._values if faults.old_readings and self._values else live
        self._clock, self._values = clock, values
        return replace(values, host_t_s=clock.host_t_s, controller_t_s=clock.controller_t_s)
