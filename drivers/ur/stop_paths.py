"""Ways to stop the arm that do not pass through ur-rtde.

1. ``stop`` on the dashboard server, or a request to the robot API of PolyScope X, ends the program,
   on a connection that is kept open.
2. A program of one line, ``stopj``, sent to the script port takes the place of the program that
   runs. Its connection is made anew each time: one made while the robot was in local mode stays
   read-only for ever, and the port streams robot states that nobody here would read.
3. The same program, sent to the primary port, which another server of the controller reads.
4. Where those are not obeyed: power off, where the first goes, upon which the brakes fall in.

Any is enough. Each is given a fixed share of time, so that a dead controller cannot hold up the
caller.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable

from drivers.ur.panel import StopOrder

SCRIPT_PORT, PRIMARY_PORT = 30003, 30001
_CONNECT_S = 0.02
_MOST_UNREAD = 16


class StopPaths:
    """The ways; `order` may be called from any thread, as often as one likes.

    Parameters
    ----------
    host:
        The controller's address.
    deceleration_rad_s2:
        Of the leading axis, for the script's ``stopj``.
    program_stop:
        What ends the program, and where it is sent.
    """

    def __init__(self, host: str, deceleration_rad_s2: float, program_stop: StopOrder) -> None:
        self._host, self._program_stop = host, program_stop
        self._script = f"stopj({deceleration_rad_s2:.3f})\n".encode()
        self._kept: socket.socket | None = None
        self._lock = threading.Lock()

    def open(self) -> None:
        """Open the connection that is kept, so that a stop need not wait for it."""
        with self._lock, contextlib.suppress(OSError):
            self._reopen()

    def order(self, *, power_off: bool = False) -> list[str]:
        """Send the stop on every way; return the names of those that took it. Never raises.

        `power_off` lets the brakes fall in, too; somebody must then switch the arm on again.
        """
        panel = self._program_stop
        ways: dict[str, Callable[[], None]] = {
            panel.name: lambda: self._by_panel(panel.message),
            "script port": lambda: self._by_script(SCRIPT_PORT),
            "primary port": lambda: self._by_script(PRIMARY_PORT),
        }
        if power_off:
            ways["power off"] = lambda: self._by_panel(panel.power_off)
        with self._lock:
            return [name for name, send in ways.items() if _sent(send)]

    def close(self) -> None:
        """Let go of the controller."""
        with self._lock:
            self._drop()

    def _by_panel(self, message: bytes) -> None:
        if not self._alive():
            self._reopen()
        assert self._kept is not None
        self._kept.sendall(message)

    def _by_script(self, port: int) -> None:
        with socket.create_connection((self._host, port), _CONNECT_S) as link:
            link.sendall(self._script)

    def _alive(self) -> bool:
        """Whether the kept connection is open; drains the answers, which nobody needs.

        One that never ends is given up: the stop must not wait for it.
        """
        if self._kept is None:
            return False
        # a socket with a time-out would wait for it in recv, whatever the flags
        self._kept.setblocking(False)
        try:
            for _ in range(_MOST_UNREAD):
                if not self._kept.recv(4096):
                    break
        except BlockingIOError:
            return True
        except OSError:
            return False
        finally:
            self._kept.settimeout(_CONNECT_S)
        return False

    def _reopen(self) -> None:
        self._drop()
        self._kept = socket.create_connection((self._host, self._program_stop.port), _CONNECT_S)

    def _drop(self) -> None:
        if self._kept is not None:
            self._kept.close()
        self._kept = None


def _sent(send: Callable[[], None]) -> bool:
    try:
        send()
    except OSError:
        return False
    return True
