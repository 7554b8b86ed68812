"""The settings document of a simulated Robotiq camera."""

from __future__ import annotations

import math
from typing import Any

from drivers.camera import FocusSetting

_RANGES = {"focus": (0, 1023), "exposure": (1, 66604), "gain": (16, 16 * 63)}


class Settings:
    """`values` are what `getcamerasettings` gives; out of range is taken as the nearest limit."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {
            "focusAuto": True,
            "focus": 400,
            "focusMin": 150,
            "focusMax": 1023,
            "exposureAuto": True,
            "exposure": 10000,
            "gain": 16,
            "whiteBalanceAuto": True,
            "lightingMode": 0,
        }

    def change(self, wanted: dict[str, Any]) -> None:
        """Take over the settings that exist."""
        for name, value in wanted.items():
            if name in _RANGES:
                low, high = _RANGES[name]
                value = min(max(int(value), low), high)
            if name in self.values:
                self.values[name] = value

    @property
    def exposure_s(self) -> float:
        """Exposure, seconds."""
        return float(self.values["exposure"]) * 1e-6

    @property
    def gain_db(self) -> float:
        """Gain, dB."""
        return 20 * math.log10(self.values["gain"] / 16)

    @property
    def focus_order(self) -> FocusSetting:
        """What the focus settings mean."""
        if self.values["focusAuto"]:
            return FocusSetting("auto")
        return FocusSetting("position", float(self.values["focus"]))
