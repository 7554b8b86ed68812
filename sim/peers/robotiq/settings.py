"""The settings document of a simulated Robotiq camera."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from drivers.camera import FocusSetting

_RANGES = {"focus": (0, 1023), "exposure": (1, 66604), "gain": (16, 16 * 63)}


class Settings:
    """`values` are what `getcamerasettings` gives; out of range is taken as the nearest limit.

    Parameters
    ----------
    source:
        `exposure_s` and `gain_db` at first.
    focus:
        Where the lens stands at first; None for one that cannot move.
    """

    def __init__(self, source: Mapping[str, float], focus: float | None) -> None:
        self.values: dict[str, Any] = {
            "exposureAuto": True,
            "exposure": round(source["exposure_s"] * 1e6),
            "gain": 16 * round(10 ** (source["gain_db"] / 20)),
            "whiteBalanceAuto": True,
            "lightingMode": 0,
        }
        if focus is not None:
            self.values |= {"focusAuto": True, "focus": _limited("focus", focus)}

    def changed(self, wanted: Mapping[str, Any]) -> Settings:
        """A copy that has taken over the settings that exist."""
        copy = Settings.__new__(Settings)
        known = {name: value for name, value in wanted.items() if name in self.values}
        copy.values = self.values | {name: _limited(name, value) for name, value in known.items()}
        return copy

    @property
    def exposure_s(self) -> float:
        """Exposure, seconds."""
        return float(self.values["exposure"]) * 1e-6

    @property
    def gain_db(self) -> float:
        """Gain, dB."""
        return 20 * math.log10(self.values["gain"] / 16)

    @property
    def focuses_itself(self) -> bool:
        """Whether the lens follows what it sees."""
        return bool(self.values.get("focusAuto"))

    @property
    def focus_order(self) -> FocusSetting:
        """What the focus settings mean."""
        if self.focuses_itself:
            return FocusSetting("auto")
        return FocusSetting("position", float(self.values["focus"]))

    def set_focus(self, position: float) -> None:
        """Note where an automatic focus ended."""
        self.values["focus"] = _limited("focus", position)


def _limited(name: str, value: Any) -> Any:
    if name not in _RANGES:
        return value
    low, high = _RANGES[name]
    return min(max(round(value), low), high)
