"""The controller's dashboard server, asked with a time-out for every answer.

Source: Universal Robots, "Dashboard Server e-Series": port 29999, one line in, one line out.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time

from drivers.errors import DeviceUnreachable
from drivers.outside import printable, receive_within

DASHBOARD_PORT = 29999
_LONGEST_LINE = 4096


class Dashboard:
    """One connection to the dashboard server; opened on first use and again after a failure.

    Answers are one printable line, shortened where they are long.
    """

    def __init__(self, host: str) -> None:
        self._host = host
        self._link: socket.socket | None = None
        self._rest = b""
        self._lock = threading.Lock()

    def ask(self, line: str, timeout_s: float = 2.0) -> str:
        """Send one line and return the answer; raises `DeviceUnreachable` after the time-out."""
        with self._lock:
            deadline = time.monotonic() + timeout_s
            try:
                if self._link is None:
                    self._open(deadline)
                assert self._link is not None
                self._rest = b""  # an answer that nobody asked for belongs to no question
                self._link.sendall(f"{line}\n".encode())
                return self._line(self._link, deadline)
            except OSError as error:
                self._drop()
                raise DeviceUnreachable(
                    f"UR controller {self._host}: the dashboard server (port {DASHBOARD_PORT}) "
                    f"did not answer '{line}' ({error}). Check power, cable and address"
                ) from None

    def close(self) -> None:
        """Let go of the server."""
        with self._lock:
            self._drop()

    def _open(self, deadline: float) -> None:
        address = (self._host, DASHBOARD_PORT)
        self._link = socket.create_connection(address, max(deadline - time.monotonic(), 1e-3))
        self._rest = b""
        self._line(self._link, deadline)

    def _line(self, link: socket.socket, deadline: float) -> str:
        while b"\n" not in self._rest:
            if len(self._rest) > _LONGEST_LINE:
                raise ConnectionError("a line without an end")
            self._rest += receive_within(link, _LONGEST_LINE, deadline)
        line, self._rest = self._rest.split(b"\n", 1)
        return printable(line.decode(errors="replace"))

    def _drop(self) -> None:
        if self._link is not None:
            with contextlib.suppress(OSError):
                self._link.close()
        self._link = None
