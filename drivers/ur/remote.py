"""Watches whether the controller is still in remote control, in a thread of its own."""

from __future__ import annotations

import threading

from drivers.errors import DeviceUnreachable
from drivers.ur.panel import Panel

_PERIOD_S = 0.5
_FAILURES_ALLOWED = 1


class RemoteWatch:
    """Asks the controller's panel twice a second.

    Attributes
    ----------
    fault:
        None, or why the arm must not be driven from here.
    """

    def __init__(self, panel: Panel) -> None:
        self._panel = panel
        self._closing = threading.Event()
        self.fault: str | None = None
        self._thread = threading.Thread(target=self._watch, name="ur-remote-watch", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the watch."""
        self._closing.set()

    def _watch(self) -> None:
        failures = 0
        while not self._closing.wait(_PERIOD_S):
            try:
                local = self._panel.in_local_mode()
                failures = 0
            except DeviceUnreachable as error:
                local, failures = False, failures + 1
                if failures > _FAILURES_ALLOWED:
                    self.fault = str(error)
            if local:
                self.fault = (
                    "the robot was switched to local mode: switch to Remote Control at the top "
                    "right of the teach pendant and connect again"
                )
