"""Our own RTDE reader: one atomic packet a cycle, with time-outs, and loss told at once.

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
from dataclasses import dataclass

from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable
from drivers.ur.plausible import implausible
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


@dataclass(frozen=True)
class Packet:
    """One cycle of the controller; every value is of the same instant.

    Attributes
    ----------
    host_t_s:
        Host clock (`time.monotonic`) when it arrived.
    values:
        The `OUTPUTS` as the controller sent them: radians, metres, seconds.
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
        as lost. It stays lost until `connect`.
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

    def connect(self, timeout_s: float = 2.0) -> None:
        """Open, negotiate, and wait for the first packet; raises `DeviceError`."""
        self.close()
        try:
            deadline_s = time.monotonic() + timeout_s
            self._link = socket.create_connection((self._host, RTDE_PORT), timeout_s)
            recipe = self._negotiate(self._link, deadline_s)
        except (OSError, struct.error) as error:
            self.close()
            raise DeviceUnreachable(
                f"UR controller {self._host}: RTDE port {RTDE_PORT} does not answer ({error}). "
                "Check power, cable and address"
            ) from None
        self._lost = None
        self._newest = None
        self._advanced_s = time.monotonic()
        self._thread = threading.Thread(
            target=self._read, args=(self._link, recipe), name="ur-rtde-reader", daemon=True
        )
        self._thread.start()
        self._await(lambda: self._newest is not None, timeout_s)
        self.newest()

    def newest(self) -> Packet:
        """Return the newest packet; raises `DeviceUnreachable` when there is no fresh one."""
        lost = self.loss()
        if lost is not None or self._newest is None:
            raise DeviceUnreachable(
                f"UR controller {self._host}: no robot state ({lost or 'nothing received'}). The "
                "arm was told to stop, and its own watchdog stops it: look whether it stands. "
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
        if self._link is not None:
            with contextlib.suppress(OSError):
                self._link.shutdown(socket.SHUT_RDWR)
            self._link.close()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=1.0)
        self._link = self._thread = None
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
        asked = struct.pack(">d", self._rate_hz) + ",".join(OUTPUTS).encode()
        answer = self._ask(link, deadline_s, Frame.SETUP_OUTPUTS, asked)
        types = answer[1:].decode(errors="replace").split(",")
        missing = [name for name, kind in zip(OUTPUTS, types, strict=False) if kind == "NOT_FOUND"]
        if missing:
            raise DeviceRefused(
                f"UR controller {self._host}: does not know {', '.join(missing)}. The flange pose "
                "needs tcp_offset, which exists from PolyScope 5.5.1 (CB3: 3.12): update it"
            )
        try:
            recipe = Recipe(OUTPUTS, types)
        except ValueError as error:
            raise DeviceError(f"UR controller {self._host}: RTDE answers {error}") from None
        if self._ask(link, deadline_s, Frame.START) != b"\x01":
            raise DeviceError(f"UR controller {self._host}: refuses to start sending its state")
        return recipe

    @staticmethod
    def _ask(link: socket.socket, deadline_s: float, kind: Frame, payload: bytes = b"") -> bytes:
        link.sendall(encode(kind, payload))
        while True:  # messages of its own may come first; the deadline is for all of them
            answered, answer = receive(link, deadline_s)
            if answered == kind:
                return answer

    def _read(self, link: socket.socket, recipe: Recipe) -> None:
        try:
            while self._lost is None:
                kind, body = receive(link, time.monotonic() + self._silence_s)
                if kind == Frame.DATA_PACKAGE:
                    self._take(Packet(time.monotonic(), recipe.unpack(body[1:])))
        except TimeoutError:
            self._lose(f"silent for {self._silence_s:.2f} s")
        except (OSError, struct.error) as error:
            self._lose(str(error))

    def _take(self, packet: Packet) -> None:
        wrong = implausible(packet.values)
        if wrong is not None:
            self._lose(f"what the controller sends cannot be: {wrong}")
            return
        with self._fresh:
            before = self._newest
            self._newest = packet
            if before is None or packet.values["timestamp"] != before.values["timestamp"]:
                self._advanced_s = packet.host_t_s
            self._fresh.notify_all()

    def _lose(self, why: str) -> None:
        with self._fresh:
            self._lost = self._lost or why
            self._fresh.notify_all()
