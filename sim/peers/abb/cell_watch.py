"""What `drivers/abb/rapid/cell_watch.mod` does on the controller, loop for loop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

_TURN_S = 0.02


class CellWatch:
    """The background task and its persistent variables.

    Parameters
    ----------
    stop_motion:
        Stops all motion tasks.

    Attributes
    ----------
    loaded, running:
        Whether the module is on this controller, and whether its task runs.
    values:
        The variables by their names behind ``cell_watch_``.
    """

    def __init__(self, stop_motion: Callable[[str], None]) -> None:
        self._stop_motion = stop_motion
        self.loaded = self.running = True
        self.values = {"beat": 0.0, "limit": 0.6, "turn": 0.0, "stops": 0.0}
        self._closing = threading.Event()

    def start(self) -> None:
        """Power on."""
        self._closing.clear()
        threading.Thread(target=self._main, name="cell-watch", daemon=True).start()

    def close(self) -> None:
        """Power off."""
        self._closing.set()

    def _main(self) -> None:
        values, heard, heard_s = self.values, 0.0, 0.0
        values["beat"] = 0.0
        while not self._closing.wait(_TURN_S):
            if not (self.loaded and self.running):
                continue
            values["turn"] = (values["turn"] + 1) % 10000
            if values["beat"] != heard:
                heard, heard_s = values["beat"], time.monotonic()
            if heard and time.monotonic() - heard_s > values["limit"]:
                self._stop_motion("link watch")
                values["beat"] = heard = 0.0
                values["stops"] += 1
