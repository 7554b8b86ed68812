"""The thread that keeps the arm in check: starts the child, watches the state, stops on a fault.

::

    no order ── order() ──> ordered ──> moving ──> done, at rest, at the target ──> no order
        │                      │           │
        └── fault, lost link, stop() ──────┴──> stop on every path, child killed, at rest?
                                                   ├── not soon: power off, too
                                                   └── not within a second: `stop_failed`

After a stop the control script is gone from the controller. It is loaded again by the next order
and never before, so nothing can drive on by itself.
"""

from __future__ import annotations

import threading
import time

from drivers.errors import DeviceError, DeviceUnreachable
from drivers.ur.motion import ChildOptions, MotionChild, MoveOrder, Phase
from drivers.ur.panel import Panel
from drivers.ur.reader import Packet, RtdeReader
from drivers.ur.remote import RemoteWatch
from drivers.ur.settings import URSettings
from drivers.ur.status import fault_in
from drivers.ur.stop_paths import StopPaths
from drivers.ur.verdicts import ProgramWatch, at_rest, missed

_CYCLE_S = 0.01
_BEAT_S = 0.2
_RESEND_S = 0.05
_STOP_CONFIRM_S, _REPEAT_S = 1.0, 5.0
_POWER_OFF_S = 0.7
"""An arm that obeys stands long before: 0.5 rad/s are braked in 0.1 s."""
_WHY_S = 0.1


class Supervisor:
    """Owns the child, the stop paths and the current order of one arm.

    Attributes
    ----------
    fault:
        None, or what stopped the arm; set until `clear`.
    stop_failed:
        None, or why it is not known that the arm stopped when it was ordered to.
    """

    def __init__(self, host: str, settings: URSettings, reader: RtdeReader, panel: Panel) -> None:
        self._reader = reader
        self._settings = settings
        self._options = ChildOptions(
            host,
            settings.rate_hz,
            settings.upper_registers,
            settings.watchdog_hz,
            settings.heartbeat_s,
        )
        self._stops = StopPaths(host, settings.stop_deceleration_rad_s2, panel.stop_order)
        self._stops.open()
        self._remote = RemoteWatch(panel)
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._child: MotionChild | None = None
        self._killed: list[MotionChild] = []
        self._child_wanted = False
        self._order: MoveOrder | None = None
        self._order_sent = False
        self._program = ProgramWatch(settings.start_timeout_s)
        self._beat_s = 0.0
        self._stop_s: float | None = None
        self._resent_s = 0.0
        self.fault: str | None = None
        self._cause_known = False
        self._tripped_s = 0.0
        self.stop_failed: str | None = None
        self._thread = threading.Thread(target=self._run, name="ur-supervisor", daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether an order, or a stop, has not come to its end."""
        return self._order is not None or self._stop_s is not None

    @property
    def ready(self) -> bool:
        """Whether the control script runs and waits for an order."""
        child = self._child
        return child is not None and child.phase is Phase.READY

    def prepare(self) -> None:
        """Have the control script started."""
        with self._lock:
            self._child_wanted = True

    def order(self, order: MoveOrder) -> None:
        """Take an order; the thread passes it on."""
        with self._lock:
            self._order, self._order_sent = order, False

    def stop(self) -> list[str]:
        """Stop the arm; return the names of the paths that took the order."""
        ways = self._stops.order(power_off=self._ignored_orders())
        with self._lock:
            self._cancel()
        return ways

    def _ignored_orders(self) -> bool:
        """Whether a stop that was ordered some time ago has not been seen obeyed."""
        since_s = self._stop_s
        return since_s is not None and time.monotonic() - since_s > _POWER_OFF_S

    def clear(self) -> None:
        """Forget a fault that the operator has mended."""
        with self._lock:
            self.fault = self.stop_failed = None
            self._cause_known = False

    def why(self) -> str | None:
        """The fault in its own words: of a stop just ordered, a packet soon gives the cause."""
        while self.fault and not self._cause_known and time.monotonic() - self._tripped_s < _WHY_S:
            time.sleep(_CYCLE_S)
        return self.fault

    def close(self) -> None:
        """Stop the arm and end the thread."""
        self._closing.set()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)
        self.stop()
        self._reap()
        self._remote.close()
        self._stops.close()

    def _cancel(self) -> None:
        """Forget the order and kill the child."""
        self._child_wanted = False
        self._order = None
        self._resent_s = time.monotonic()
        # one that is repeated is as old as its first order
        self._stop_s = self._stop_s or self._resent_s
        if self._child is not None:
            self._child.kill()
            self._killed.append(self._child)
            self._child = None

    def _reap(self) -> None:
        """Wait for killed children, then stop again: what they had sent may have come in late."""
        while self._killed:
            self._killed.pop().reap()
            self._stops.order()

    def _run(self) -> None:
        while not self._closing.wait(_CYCLE_S):
            try:
                self._reap()
                packet = self._reader.newest()
                with self._lock:
                    self._watch(packet)
            except DeviceUnreachable as error:
                self._trip(str(error))
                self._reap()
                self._repeat_stop()
                # only a reading shows whether the arm stands
                self._reader.reopen()
            except Exception as error:
                # nobody would watch the arm any more: whatever it is, stop first
                self._trip(f"the driver's supervision failed: {error!r}")

    def _watch(self, packet: Packet) -> None:
        reported = fault_in(packet)
        fault = reported or self._remote.fault or self._program.fault(self._child, packet)
        if fault is not None:
            self._trip(fault)
        # the child may notice before the packet comes that says why
        self.fault, self._cause_known = (
            reported or self.fault,
            self._cause_known or reported is not None,
        )
        self._see_stop_through(packet)
        if self.fault is None and self._stop_s is None:
            self._drive(packet)

    def _trip(self, fault: str) -> None:
        if self.fault is None:
            self._tripped_s = time.monotonic()
            self.fault = fault
            self.stop()

    def _see_stop_through(self, packet: Packet) -> None:
        if self._stop_s is None:
            return
        now = time.monotonic()
        if at_rest(packet) and packet.host_t_s > self._stop_s:
            self._stop_s = self.stop_failed = None
        elif now - self._stop_s > _STOP_CONFIRM_S:
            self.stop_failed = (
                f"the arm still moves {_STOP_CONFIRM_S:g} s after it was ordered to stop"
            )
        self._repeat_stop()

    def _repeat_stop(self) -> None:
        """Send a stop that is not confirmed again, but not for ever: others may use the arm."""
        now = time.monotonic()
        pending = self._stop_s is not None and now - self._stop_s < _REPEAT_S
        if pending and now - self._resent_s > _RESEND_S:
            self._stops.order(power_off=self._ignored_orders())
            self._resent_s = now

    def _drive(self, packet: Packet) -> None:
        if self._child is None:
            if self._child_wanted or self._order is not None:
                self._child = MotionChild(self._options)
            return
        self._beat()
        if self._child.phase is not Phase.READY or self._order is None:
            return
        if not self._order_sent:
            self._child.move(self._order)
            self._order_sent = True
        elif at_rest(packet) and time.monotonic() - packet.host_t_s < self._child.in_phase_s:
            # a packet from before the child reported it may be from before the motion
            order, self._order = self._order, None
            off = missed(order, packet)
            if off is not None:
                self._trip(off)

    def _beat(self) -> None:
        if self._child is not None and time.monotonic() - self._beat_s > _BEAT_S:
            self._child.beat()
            self._beat_s = time.monotonic()

    def wait_ready(self, timeout_s: float) -> None:
        """Wait until the control script runs; raises `DeviceError` when it does not."""
        deadline = time.monotonic() + timeout_s
        while not self.ready:
            if self.fault is not None:
                raise DeviceError(self.fault)
            if time.monotonic() > deadline:
                raise DeviceError("the control script did not start in time")
            time.sleep(_CYCLE_S)
