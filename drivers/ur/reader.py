"""Our own RTDE reader: one atomic packet a cycle, with time-outs, and loss reported at once.

ur-rtde's receive interface goes on answering the last pose after the link is gone, takes every
value under a lock of its own, and cannot read the TCP offset; so poses do not come from it.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable
from drivers.ur.plausible import implausible
from drivers.ur.sample_times import SampleTimes
from drivers.ur.wire import PROTOCOL_VERSION, RTDE_PORT, Frame, Recipe, Value, encode, receive

OUTPUTS = [
    "timestamp",
    "actual_q",
    "actual_qd",
    "target_q",
    "actual_TCP_pose",
    "tcp_offset",
    "safety_status_bits",
    "robot_mode",
    "runtime_state",
]
OPTIONAL = ["payload"]
"""What older controllers do not report."""
_UNKNOWN = "NOT_FOUND"
_REOPEN_S, _REOPEN_PAUSE_S = 0.5, 0.05


@dataclass(frozen=True)
class Packet:
    """One cycle of the controller; every value is of the same instant.

    Attributes
    ----------
    host_t_s:
        Host clock (`time.monotonic`) when it was sampled: see `SampleTimes`.
    values:
        The `OUTPUTS`, and `OPTIONAL` ones, as the controller sent them: radians, metres, seconds,
        kilograms.
    """

    host_t_s: float
    values: dict[str, Value]

    def number(self, name: str) -> float:
        """Return a scalar."""
        value = self.values[name]
        assert not isinstance(value, tuple)
        return value

    def vector(self, name: str) -> tuple[float, ...]:
        """Return a vector."""
        value = self.values[name]
        assert isinstance(value, tuple)
        return value


class RtdeReader:
    """Reads the controller's state in a thread of its own.

    Parameters
    ----------
    host:
        The controller's address.
    rate_hz:
        Packets a second to ask for.
    silence_s:
        Without a packet, or without the controller's clock going on, for so long, the link counts
        as lost. It stays lost until `connect`, or a `reopen` that succeeds.
    """

    def __init__(self, host: str, *, rate_hz: float = 125.0, silence_s: float = 0.25) -> None:
        self._host = host
        self._rate_hz = rate_hz
        self._silence_s = silence_s
        self._link: socket.socket | None = None
        self._newest: Packet | None = None
        self._advanced_s = 0.0
        self._lost: str | None = "not connected"
        self._fresh = threading.Condition()
        self._thread: threading.Thread | None = None
        self._reopening: threading.Thread | None = None
        self._closed = True

    def connect(self, timeout_s: float = 2.0) -> None:
        """Open, negotiate, and wait for the first packet; raises `DeviceError`."""
        self.close()
        self._closed = False
        self._open(timeout_s)
        self._await(lambda: self._newest is not None, timeout_s)
        self.newest()

    def reopen(self) -> None:
        """Try a lost link again, in a thread of its own; nothing happens while one is at it."""
        trying = self._reopening is not None and self._reopening.is_alive()
        if self._lost is None or self._closed or trying:
            return
        self._reopening = threading.Thread(
            target=self._try_again, name="ur-rtde-reopen", daemon=True
        )
        self._reopening.start()

    def _try_again(self) -> None:
        with contextlib.suppress(DeviceError):
            self._open(_REOPEN_S)
        time.sleep(_REOPEN_PAUSE_S)

    def _open(self, timeout_s: float) -> None:
        with contextlib.ExitStack() as opened:
            try:
                deadline_s = time.monotonic() + timeout_s
                link = socket.create_connection((self._host, RTDE_PORT), timeout_s)
                opened.callback(link.close)
                recipe = self._negotiate(link, deadline_s)
            except (OSError, struct.error) as error:
                raise DeviceUnreachable(
                    f"UR controller {self._host}: RTDE port {RTDE_PORT} does not answer ({error})."
                    " Check power, cable and address"
                ) from None
            self._begin(link, recipe)
            opened.pop_all()

    def _begin(self, link: socket.socket, recipe: Recipe) -> None:
        """Read from a link that is open, unless the reader was closed meanwhile."""
        with self._fresh:
            if self._closed:
                link.close()
                return
            if self._link is not None:
                self._link.close()
            self._link, self._lost, self._newest = link, None, None
            self._advanced_s = time.monotonic()
            self._thread = threading.Thread(
                target=self._read, args=(link, recipe), name="ur-rtde-reader", daemon=True
            )
            self._thread.start()

    def newest(self) -> Packet:
        """Return the newest packet; raises `DeviceUnreachable` when there is no fresh one."""
        lost = self.loss()
        if lost is not None or self._newest is None:
            raise DeviceUnreachable(
                f"UR controller {self._host}: no robot state ({lost or 'nothing received'}). The "
                "arm was ordered to stop, and its own watchdog stops it: look whether it stands. "
                "Check the network and the controller, then connect again"
            )
        return self._newest

    def loss(self) -> str | None:
        """Return why there is no fresh state, or None while there is."""
        # a thread that was kept from running finds the packets still queued: give it a moment
        self._await(lambda: self._silent_s() < self._silence_s, 0.03)
        if self._lost is None and self._silent_s() >= self._silence_s:
            return f"silent for {self._silent_s():.2f} s"
        return self._lost

    def close(self) -> None:
        """Let go of the controller."""
        with self._fresh:
            self._closed = True
            link, thread = self._link, self._thread
            self._link = self._thread = None
        if link is not None:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)
            link.close()
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout=1.0)
        self._lost = "not connected"

    def _silent_s(self) -> float:
        return time.monotonic() - self._advanced_s

    def _await(self, condition: Callable[[], bool], timeout_s: float) -> None:
        with self._fresh:
            self._fresh.wait_for(lambda: condition() or self._lost is not None, timeout_s)

    def _negotiate(self, link: socket.socket, deadline_s: float) -> Recipe:
        version = struct.pack(">H", PROTOCOL_VERSION)
        if self._ask(link, deadline_s, Frame.REQUEST_PROTOCOL_VERSION, version) != b"\x01":
            raise DeviceRefused(f"UR controller {self._host}: speaks no RTDE version 2: update it")
        names = [*OUTPUTS, *OPTIONAL]
        types = self._types(link, deadline_s, names)
        unknown = [name for name, kind in zip(names, types, strict=False) if kind == _UNKNOWN]
        missing = [name for name in unknown if name in OUTPUTS]
        if missing:
            raise DeviceRefused(
                f"UR controller {self._host}: does not know {', '.join(missing)}. The flange pose "
                "needs tcp_offset, which exists from PolyScope 5.5.1 (CB3: 3.12): update it"
            )
        if unknown:
            names = OUTPUTS
            types = self._types(link, deadline_s, names)
        try:
            recipe = Recipe(names, types)
        except ValueError as error:
            raise DeviceError(f"UR controller {self._host}: RTDE answers {error}") from None
        if self._ask(link, deadline_s, Frame.START) != b"\x01":
            raise DeviceError(f"UR controller {self._host}: refuses to start sending its state")
        return recipe

    def _types(self, link: socket.socket, deadline_s: float, names: list[str]) -> list[str]:
        asked = struct.pack(">d", self._rate_hz) + ",".join(names).encode()
        answer = self._ask(link, deadline_s, Frame.SETUP_OUTPUTS, asked)
        return answer[1:].decode(errors="replace").split(",")

    @staticmethod
    def _ask(link: socket.socket, deadline_s: float, kind: Frame, payload: bytes = b"") -> bytes:
        link.sendall(encode(kind, payload))
        while True:  # messages of its own may come first; the deadline is for all of them
            answered, answer = receive(link, deadline_s)
            if answered == kind:
                return answer

    def _read(self, link: socket.socket, recipe: Recipe) -> None:
        times = SampleTimes()
        try:
            while self._link is link and self._lost is None:
                kind, body = receive(link, time.monotonic() + self._silence_s)
                if kind == Frame.DATA_PACKAGE:
                    packet = Packet(time.monotonic(), recipe.unpack(body[1:]))
                    sampled_s = times.host_t_s(packet.host_t_s, packet.number("timestamp"))
                    self._take(link, replace(packet, host_t_s=sampled_s))
        except TimeoutError:
            self._lose(link, f"silent for {self._silence_s:.2f} s")
        except (OSError, struct.error) as error:
            self._lose(link, str(error))

    def _take(self, link: socket.socket, packet: Packet) -> None:
        wrong = implausible(packet.values)
        if wrong is not None:
            self._lose(link, f"what the controller sends cannot be: {wrong}")
            return
        with self._fresh:
            before = self._newest
            self._newest = packet
            if before is None or packet.values["timestamp"] != before.values["timestamp"]:
                self._advanced_s = time.monotonic()
            self._fresh.notify_all()

    def _lose(self, link: socket.socket, why: str) -> None:
        """Give a link up; one that another has taken the place of counts no more."""
        with self._fresh:
            if self._link is link:
                self._lost = self._lost or why
            self._fresh.notify_all()
