"""The controller's own watch over the link: a RAPID task that stops a motion nobody vouches for.

A stop over Robot Web Services needs the cable. `rapid/cell_watch.mod` runs on the controller as a
background task: while a motion of ours runs, a variable of its is counted up from here, and when
that ceases it stops all motion tasks by itself.
"""

from __future__ import annotations

import time
from typing import Any

from drivers.abb.rws import named
from drivers.errors import DeviceRefused, DeviceUnreachable

TASK, MODULE = "T_CELL_WATCH", "cell_watch"
_TURN_S = 0.1
_BEATS_IN_LIMIT = 3
_LAST_BEAT = 9999
_MEND = (
    "load cell_watch.mod and cell_watch.cfg (drivers/abb/rapid, see docs/drivers-arms.md) and "
    "restart the controller; or write `link_watch: false`, and a cut cable stops nothing"
)


class LinkWatch:
    """Vouches for one motion at a time.

    Parameters
    ----------
    url:
        Of the controller, for messages.
    rws:
        A session of Robot Web Services; used by the thread that calls.
    limit_s:
        How long the controller waits for a sign; None for no watch at all.
    """

    def __init__(self, url: str, rws: Any, limit_s: float | None) -> None:
        self._url, self._rws, self._limit_s = url, rws, limit_s
        self._beat = 0
        self._beaten_s = 0.0
        self._stops = "0"

    def check(self) -> None:
        """See that the task runs; raises `DeviceError`. Nothing is changed."""
        if self._limit_s is None:
            return
        try:
            with named(self._url):
                turn = self._get("turn")
                time.sleep(_TURN_S)
                runs = self._get("turn") != turn
        except DeviceUnreachable:
            raise
        except DeviceRefused as missing:
            raise DeviceRefused(
                f"ABB arm {self._url}: has no task that watches the link ({missing}): {_MEND}"
            ) from None
        if not runs:
            raise DeviceRefused(
                f"ABB arm {self._url}: the task {TASK}, which watches the link, does not run: "
                "start it on the FlexPendant (it is a background task), or restart the controller"
            )

    def reset(self) -> None:
        """Set the task's limit, and forget whatever a run before left there."""
        if self._limit_s is not None:
            self._set("beat", 0)
            self._set("limit", self._limit_s)
            self._stops = self._get("stops")

    def begin(self) -> None:
        """A motion is about to start: from now on the controller waits for `beat`."""
        if self._limit_s is not None:
            self._count_up()

    def beat(self) -> None:
        """Vouch for the motion, as often as the limit asks for."""
        every_s = (self._limit_s or 0.0) / _BEATS_IN_LIMIT
        if self._beat and time.monotonic() - self._beaten_s > every_s:
            self._count_up()

    def end(self) -> None:
        """The motion is over: nothing is watched any more."""
        if self._beat:
            self._set("beat", 0)
            self._beat = 0

    def stopped(self) -> str | None:
        """Return why the controller stopped the motion by itself, or None."""
        if self._limit_s is None or self._get("stops") == self._stops:
            return None
        self._stops = self._get("stops")
        return (
            f"the controller stopped the motion, for it had heard nothing for {self._limit_s:g} s: "
            "check the cable and what else loads this computer"
        )

    def _count_up(self) -> None:
        self._beat = self._beat % _LAST_BEAT + 1
        self._set("beat", self._beat)
        self._beaten_s = time.monotonic()

    def _get(self, name: str) -> str:
        return str(self._rws.get_rapid_variable(f"{MODULE}/{MODULE}_{name}", TASK))

    def _set(self, name: str, value: float) -> None:
        self._rws.set_rapid_variable(f"{MODULE}/{MODULE}_{name}", f"{value:g}", TASK)
