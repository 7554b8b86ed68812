"""Two ways to stop the arm: from a thread of this process, and from the guard's process.

Both hold sessions that are logged in, and neither waits for whatever else is being asked of the
controller. See `drivers.abb.guard` for what they send.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from drivers.abb.guard import MOTORS_OFF, READY, SESSION, STOP, StopSession
from drivers.abb.rws import login_in
from drivers.abb.settings import ABBSettings
from drivers.abb.transport import silent
from drivers.errors import DeviceUnreachable
from drivers.outside import printable

_GUARD = Path(__file__).with_name("guard.py")
_ANSWER_S = 0.04
_GUARD_START_S = 10.0
_CLOSE_S = 1.0


class Stopper:
    """Sends stops for one arm.

    Attributes
    ----------
    failure:
        None, or why the newest stop was not taken.
    """

    def __init__(self, url: str, settings: ABBSettings, generation: int) -> None:
        self._url = url
        login = login_in(url, settings)
        options: dict[str, Any] = {
            "url": url,
            "user": login.user,
            "password": login.password,
            "timeout_s": settings.read_timeout_s,
            "certificate_sha256": settings.certificate_sha256,
            "generation": generation,
        }
        self._session = StopSession(**options)
        self._login = json.dumps(options)
        self._guard: subprocess.Popen[str] | None = None
        self._asked = threading.Event()
        self._answered = threading.Event()
        self._closing = self._motors_off = False
        self.failure: str | None = None
        self._thread = threading.Thread(target=self._serve, name="abb-stop", daemon=True)

    def open(self) -> None:
        """Log in and start the guard; raises `DeviceUnreachable`."""
        try:
            self._session.log_in()
        except OSError as error:
            raise silent(self._url, error) from None
        self._guard = subprocess.Popen(
            [sys.executable, "-P", str(_GUARD)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            # an interrupt typed at the terminal must not take the guard along
            start_new_session=True,
        )
        self._order_guard(self._login)
        self._await_guard(self._guard)
        self._thread.start()

    def gives_back(self, cookie: str) -> None:
        """What the session with this cookie is master of is released should this process die."""
        self._order_guard(f"{SESSION}{cookie}")

    def order(self, *, motors_off: bool = False) -> bool:
        """Send the stop on both ways; return whether the answer came at once, see `failure`.

        `motors_off` switches the motors off, too; somebody must then switch them on again.
        """
        self.failure = None
        self._answered.clear()
        self._motors_off = motors_off
        self._order_guard(MOTORS_OFF if motors_off else STOP)
        self._asked.set()
        return self._answered.wait(_ANSWER_S)

    def close(self) -> None:
        """Stop the arm and end the guard."""
        self._closing = True
        self._asked.set()
        if self._thread.is_alive():
            self._thread.join(timeout=_CLOSE_S)
        if self._guard is not None:
            self._end_guard(self._guard)

    def _serve(self) -> None:
        while not self._closing:
            self._asked.wait()
            self._asked.clear()
            self.failure = self._session.stop(motors_off=self._motors_off)
            self._answered.set()

    def _await_guard(self, guard: subprocess.Popen[str]) -> None:
        assert guard.stdout is not None
        late = threading.Timer(_GUARD_START_S, guard.kill)
        late.start()
        greeting = guard.stdout.readline().strip()
        late.cancel()
        if greeting != READY:
            self._end_guard(guard)
            why = greeting or f"no word from it within {_GUARD_START_S:g} s"
            raise DeviceUnreachable(
                f"ABB arm {self._url}: the process that is to stop the arm should this one die "
                f"could not log in ({printable(why)}). Nothing moves without it; try again"
            )

    def _order_guard(self, line: str) -> None:
        if self._guard is not None and self._guard.stdin is not None:
            with contextlib.suppress(OSError, ValueError):
                self._guard.stdin.write(line + "\n")
                self._guard.stdin.flush()

    @staticmethod
    def _end_guard(guard: subprocess.Popen[str]) -> None:
        for pipe in (guard.stdin, guard.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        # one that takes longer is still trying to stop the arm, and ends by itself
        with contextlib.suppress(subprocess.TimeoutExpired):
            guard.wait(timeout=_CLOSE_S)
