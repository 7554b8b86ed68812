"""The device's motorised lens: takes time, is busy meanwhile, must be initialised first."""

from __future__ import annotations

import time
from collections.abc import Callable

from drivers.camera import Camera, FocusSetting
from drivers.errors import DeviceError
from sim.peers.gige.features import OPTIC_STATUS


class Lens:
    """A focus stepper over the source's focus.

    Parameters
    ----------
    order:
        Runs a job in the thread that owns the source.
    steps_s:
        Speed of the stepper, steps per second.
    """

    def __init__(
        self,
        source: Camera,
        order: Callable[[Callable[[], None]], None],
        start_step: int,
        steps_s: float,
    ) -> None:
        self._source, self._order, self._steps_s = source, order, steps_s
        self._step = start_step
        self._jobs_open = 0
        self._still_at_s = 0.0
        self._initialized = self._failed = False

    @property
    def step(self) -> int:
        """Where the lens is, or will be when it is ready."""
        return self._step

    @property
    def status(self) -> int:
        """The SFNC status, as its register value."""
        if not self._initialized:
            return OPTIC_STATUS["NotInitialized"]
        if self._jobs_open or time.monotonic() < self._still_at_s:
            return OPTIC_STATUS["Busy"]
        return OPTIC_STATUS["Error" if self._failed else "Ready"]

    def initialize(self) -> None:
        """Reference the stepper."""
        self._initialized = True

    def move_to(self, step: int) -> None:
        """Begin to move to that step."""
        self._begin(FocusSetting("position", float(step)))

    def focus_once(self) -> None:
        """Begin an automatic focus."""
        self._begin(FocusSetting("auto"))

    def _begin(self, setting: FocusSetting) -> None:
        self._jobs_open += 1
        self._order(lambda: self._do(setting))

    def _do(self, setting: FocusSetting) -> None:
        self._failed = False
        try:
            reached = self._source.focus(setting)
        except DeviceError:
            self._failed, reached = True, None
        step = round(self._step if reached is None else reached)
        self._still_at_s = time.monotonic() + abs(step - self._step) / self._steps_s
        self._step = step
        self._jobs_open -= 1
