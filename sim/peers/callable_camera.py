"""A camera protocol object around any function that makes a picture: a source for the peers."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from drivers.camera import FocusSetting, Frame

Picture = Callable[["CallableCamera"], NDArray[np.generic]]


class CallableCamera:
    """Gives `picture(self)` at each grab; the function may look at exposure, gain and focus.

    Parameters
    ----------
    best_focus:
        Where an automatic focus ends, steps.
    """

    tried_on_hardware = True

    def __init__(self, picture: Picture, best_focus: float = 4200.0) -> None:
        self._picture, self._best_focus = picture, best_focus
        self.exposure_s, self.gain_db, self.focus_position = 0.01, 0.0, 5000.0
        self.grabs = 0

    def connect(self) -> None:
        """Nothing to open."""

    def configure(
        self, *, exposure_s: float | None = None, gain_db: float | None = None
    ) -> Mapping[str, float]:
        """Remember exposure and gain."""
        self.exposure_s = self.exposure_s if exposure_s is None else exposure_s
        self.gain_db = self.gain_db if gain_db is None else gain_db
        return {"exposure_s": self.exposure_s, "gain_db": self.gain_db}

    def focus(self, setting: FocusSetting) -> float | None:
        """Remember the focus."""
        if setting.mode == "auto":
            self.focus_position = self._best_focus
        elif setting.position is not None:
            self.focus_position = setting.position
        return self.focus_position

    def grab(self, timeout_s: float) -> Frame:
        """The picture as it is now."""
        self.grabs += 1
        return Frame(self._picture(self), host_t_s=time.monotonic())

    def close(self) -> None:
        """Nothing to close."""
