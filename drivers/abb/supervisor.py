"""The thread that polls the controller, passes on one order at a time, and stops on a fault.

::

    no order ── order() ──> starting ──> RAPID running ──> stopped at the target ──> no order
        │                      │              │
        └── fault, lost link, stop() ─────────┴──> stop on both ways, until RAPID has stopped
                                                   └── not soon: motors off, too

While a stop is not confirmed nobody vouches for the motion, so that the controller's own watch
over the link ends it as well. A stop that falls between the requests of a start keeps the start
from being sent; one that crosses it on the wire is sent again.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.link_watch import LinkWatch
from drivers.abb.pace import Pace
from drivers.abb.program import build_program, missed
from drivers.abb.readings import Reading, read_rws
from drivers.abb.rws import Cancelled, named, open_rws
from drivers.abb.rws2 import Rws2
from drivers.abb.settings import ABBSettings
from drivers.abb.status import failure_in_log, fault_in
from drivers.abb.stopper import Stopper
from drivers.arm import MoveTarget
from drivers.errors import DeviceError, DeviceUnreachable

_AT_REST_RAD = 1e-4
_PANEL_EVERY, _POSE_EVERY = 9, 2
_STOP_CONFIRM_S = 2.0
_MOTORS_OFF_S = 0.7
_CLOSE_S = 1.0
_START_S = 0.5  # between the answer to a start and the motion
_START_ACTIONS = ("rapid/execution?action=start", "rapid/execution/start")  # of RWS 1.0 and 2.0


@dataclass
class _Order:
    target: MoveTarget
    started_s: float | None = None


class Supervisor:
    """Owns the polling session, the stopper and the current order of one arm.

    Attributes
    ----------
    fault:
        None, or what stopped the arm.
    stop_failed:
        None, or why it is not known that the arm stopped when it was ordered to.
    newest:
        The newest reading.
    """

    def __init__(self, url: str, settings: ABBSettings, generation: int) -> None:
        self._url = url
        self._settings = settings
        self._rws = open_rws(url, settings, generation, self._check_cancelled)
        self._stopper = Stopper(url, settings, generation)
        self._watch = LinkWatch(url, self._rws, settings.link_watch_s)
        self._pace = Pace(settings.poll_s)
        self._lock = threading.RLock()
        self._cancelled = threading.Event()
        self._wake = threading.Event()
        self._closing = False
        self._order: _Order | None = None
        self._stop_s: float | None = None
        self._polls = 0
        self._still = self._running = False
        self.fault: str | None = None
        self.stop_failed: str | None = None
        self.newest: Reading | None = None
        self.world_from_base = RigidTransform.identity()
        self._thread = threading.Thread(target=self._run, name="abb-supervisor", daemon=True)

    @property
    def rws(self) -> Any:
        """The polling session, for questions before `start`."""
        return self._rws

    @property
    def busy(self) -> bool:
        """Whether an order, or a stop, has not come to its end, or the arm moves for itself."""
        return self._order is not None or self._stop_s is not None or not self._still

    @property
    def silent_s(self) -> float:
        """Age of the newest reading."""
        return np.inf if self.newest is None else time.monotonic() - self.newest.host_t_s

    def start(self, world_from_base: RigidTransform) -> None:
        """Log the stopper in, take the first readings, and begin to poll; raises `DeviceError`."""
        self.world_from_base = world_from_base
        self._watch.check()
        with named(self._url):
            self._watch.reset()
        self._stopper.open()
        if isinstance(self._rws, Rws2):
            self._stopper.gives_back(self._rws.cookie)
        self._poll()
        self._poll()
        self._thread.start()

    def order(self, target: MoveTarget) -> None:
        """Take an order; the thread passes it on."""
        with self._lock:
            self._cancelled.clear()
            self._order = _Order(target)
        self._wake.set()

    def stop(self) -> str | None:
        """Stop the arm; return why the stop was not taken, or None."""
        self._cancelled.set()
        answered = self._stopper.order(motors_off=self._ignored_orders())
        with self._lock:
            self._order = None
            # one that is repeated is as old as its first order
            self._stop_s = self._stop_s or time.monotonic()
        self._wake.set()
        if not answered and self.silent_s > self._settings.silence_s:
            return "the controller is silent"
        return self._stopper.failure

    def _ignored_orders(self) -> bool:
        """Whether a stop that was ordered some time ago has not been seen obeyed."""
        since_s = self._stop_s
        return since_s is not None and time.monotonic() - since_s > _MOTORS_OFF_S

    def close(self) -> None:
        """Stop the arm and end the thread."""
        self._closing = True
        self._cancelled.set()
        self._wake.set()
        self._stopper.close()
        if self._thread.is_alive():
            self._thread.join(timeout=_CLOSE_S)
        # a session that hangs in a request cannot be asked to give its mastership back
        if isinstance(self._rws, Rws2) and not self._thread.is_alive():
            self._rws.close()

    def _check_cancelled(self, method: str, address: str) -> None:
        if not any(action in address for action in _START_ACTIONS):
            return
        if self._cancelled.is_set() or self._closing:
            raise Cancelled(method)
        self._watch.begin()

    def _run(self) -> None:
        while not self._closing:
            try:
                self._begin_order()
                self._poll()
                self._judge()
            except Cancelled:
                continue
            except DeviceUnreachable as error:
                if self.silent_s > self._settings.silence_s:
                    self._trip(str(error))
            except DeviceError as error:
                self._trip(self._explained(error))
            except Exception as error:
                # nobody would watch the arm any more: whatever it is, stop first
                self._trip(f"the driver's supervision failed: {error!r}")
            self._wake.wait(self._pace.pause_s(running=self._running, still=self._still))
            self._wake.clear()

    def _begin_order(self) -> None:
        order, reading = self._order, self.newest
        if order is None or order.started_s is not None or reading is None:
            return
        from abb_motion_program_exec import abb_motion_program_exec_client as client

        program = build_program(order.target, reading, self.world_from_base)
        with named(self._url):
            executor = client.MotionProgramExecClient(abb_client=self._rws)
            executor.execute_motion_program(program, wait=False)
        order.started_s = time.monotonic()
        self._pace.begin(order.target, reading)
        self._still = False
        if self._cancelled.is_set():
            self._stopper.order()

    def _poll(self) -> None:
        """Vouch for the motion; ask whether RAPID runs, and where the arm is.

        At rest, where nothing has changed, one question in a while does for the former.
        """
        self._polls += 1
        in_turn = self._polls % _PANEL_EVERY == 0
        with named(self._url):
            self._confirm_guard()
            if in_turn or not self._still:
                self._running = self._rws.get_execution_state().ctrlexecstate == "running"
            self._still = self._still and not self._running
            if not self._running or self._polls % _POSE_EVERY == 0:
                limits_rad = self._settings.joint_limits_rad
                self._take(read_rws(self._rws, time.monotonic(), limits_rad, self.newest))
            panel = fault_in(self._rws) if in_turn else None
        if panel is not None:
            self._trip(panel)

    def _confirm_guard(self) -> None:
        if self._order is None and self._still:
            self._watch.end()
        elif self._stop_s is None:
            self._watch.beat()

    def _take(self, reading: Reading) -> None:
        before = self.newest
        moved = before is None or _apart(before, reading) > _AT_REST_RAD
        self.newest, self._still = reading, not (self._running or moved)
        if self._running:
            self._pace.on_the_way(reading)

    def _judge(self) -> None:
        with self._lock:
            stop_again = self._stop_pending()
            off = self._end_order()
        if stop_again:
            self._stopper.order(motors_off=self._ignored_orders())
        if off is not None:
            self._trip(self._reason(off))

    def _end_order(self) -> str | None:
        """Forget an order that came to its end; return how far off the arm then is, if it is."""
        order, reading = self._order, self.newest
        if order is None or order.started_s is None or reading is None or not self._still:
            return None
        off = missed(order.target, reading)
        if off is not None and time.monotonic() - order.started_s < _START_S:
            return None
        self._order = None
        return off

    def _stop_pending(self) -> bool:
        """Whether a stop is still to be confirmed."""
        if self._stop_s is None or self.newest is None:
            return False
        if self._still and self.newest.host_t_s > self._stop_s:
            self._stop_s = self.stop_failed = None
            return False
        if time.monotonic() - self._stop_s > _STOP_CONFIRM_S:
            self.stop_failed = f"it still moves {_STOP_CONFIRM_S:g} s after it was ordered to stop"
        return True

    def _reason(self, off: str) -> str:
        with named(self._url):
            panel = fault_in(self._rws)
            if panel is not None:
                return panel
            failure = self._watch.stopped() or failure_in_log(self._rws)
        why = failure or "no reason logged; look who or what stopped it, or moved it there"
        return f"the motion ended {off} from its target ({why})"

    def _explained(self, error: DeviceError) -> str:
        """What the panel says, which may be why something was refused, or else the error."""
        try:
            with named(self._url):
                return fault_in(self._rws) or str(error)
        except DeviceError:
            return str(error)

    def _trip(self, fault: str) -> None:
        if self.fault is None:
            self.fault = fault
            self.stop()


def _apart(a: Reading, b: Reading) -> float:
    return float(np.abs(np.subtract(a.joints_rad, b.joints_rad)).max())
