"""Exposure, gain and focus of a Robotiq wrist camera, as far as its firmware lets them be seen.

Raw values (read off one firmware): `exposure` 1 to 66604 us, `gain` 16 times 1 to 63, `focus` 0 to
1023. Nothing that was not read back is claimed.
"""

from __future__ import annotations

import math
import time
from typing import Any

from drivers.camera import FocusSetting
from drivers.errors import DeviceError, DeviceRefused
from drivers.focus import MODES
from drivers.robotiq_http import RobotiqHttp

Settings = dict[str, Any]

_AUTOS = ("exposureAuto", "whiteBalanceAuto")
_NUMBERS, _MOST = ("exposure", "gain", "focus"), 1e6
_UNIT_GAIN = 16
_LARGEST_GAIN_FACTOR = 63
_LONGEST_EXPOSURE_US = 66604
_LARGEST_FOCUS = 1023
_POLL_S = 0.05
_SAME_IN_A_ROW = 4
NO_SETTINGS = (
    "this firmware does not report its settings, so they cannot be set and confirmed from here; "
    "set them on the teach pendant and leave them out of the plan"
)


class RobotiqSettings:
    """Settings over an open connection; `supported` is false until `probe` found them."""

    def __init__(self, http: RobotiqHttp) -> None:
        self._http = http
        self.supported = False
        self._locked_at: float | None = None

    def probe(self, deadline_s: float) -> None:
        """Find out whether this firmware reports its settings; if so, autos off."""
        settings = self._http.settings(deadline_s)
        self.supported = settings is not None
        if settings:
            _checked(settings)
            self._change({name: False for name in _AUTOS if name in settings}, deadline_s)

    def read(self, deadline_s: float) -> Settings:
        """All settings as the camera reports them; empty where it states none.

        Raises
        ------
        DeviceError
            One of those that are used here is not the number or the switch that it must be.
        """
        return _checked(self._http.settings(deadline_s) or {}) if self.supported else {}

    def set(
        self, exposure_s: float | None, gain_db: float | None, deadline_s: float
    ) -> dict[str, float]:
        """Set what is given and return `exposure_s` and `gain_db` as read back."""
        wanted: Settings = {}
        if exposure_s is not None:
            wanted["exposure"] = _within(round(exposure_s * 1e6), 1, _LONGEST_EXPOSURE_US, "us")
        if gain_db is not None:
            factor = round(10 ** (gain_db / 20))
            wanted["gain"] = _UNIT_GAIN * _within(factor, 1, _LARGEST_GAIN_FACTOR, "times")
        return values_of(self._change(wanted, deadline_s) if wanted else self.read(deadline_s))

    def focus(self, setting: FocusSetting, deadline_s: float) -> float | None:
        """Focus and lock; returns the position read back, None where it cannot be known.

        Raises
        ------
        DeviceRefused
            The mode needs settings that this firmware does not have, or was not taken.
        """
        if setting.mode not in MODES:
            raise DeviceRefused(f"focus mode '{setting.mode}' is none of {', '.join(MODES)}")
        if not (self.supported and "focusAuto" in self.read(deadline_s)):
            if setting.mode == "hold":
                return None
            raise DeviceRefused(f"focus mode '{setting.mode}': {NO_SETTINGS}")
        wanted: Settings = {"focusAuto": False}
        if setting.mode == "position":
            if setting.position is None:
                raise DeviceRefused("focus mode 'position' needs a position, 0 to 1023")
            wanted["focus"] = _within(round(setting.position), 0, _LARGEST_FOCUS, "steps")
        elif setting.mode == "auto":
            wanted["focus"] = self._focus_automatically(deadline_s)
        got = self._change(wanted, deadline_s)
        self._locked_at = float(got["focus"]) if "focus" in got else None
        return self._locked_at

    def focus_locked(self, settings: Settings) -> bool:
        """Whether these settings show the focus where it was locked.

        Raises
        ------
        DeviceRefused
            It was locked and no longer is.
        """
        if self._locked_at is None:
            return False
        if settings.get("focusAuto") is not False or settings.get("focus") != self._locked_at:
            raise DeviceRefused(
                f"the focus was locked at {self._locked_at:g} and the camera now has "
                f"{settings.get('focus', 'none')} (automatic: {settings.get('focusAuto')}); "
                "somebody else changes its settings"
            )
        return True

    def _focus_automatically(self, deadline_s: float) -> int:
        if self.read(deadline_s)["focusAuto"]:
            # one that is on already may be resting where it stood for another view
            self._change({"focusAuto": False}, deadline_s)
        self._change({"focusAuto": True}, deadline_s)
        seen: list[int] = []
        while time.monotonic() < deadline_s:
            seen.append(int(self.read(deadline_s)["focus"]))
            if len(seen) >= _SAME_IN_A_ROW and len(set(seen[-_SAME_IN_A_ROW:])) == 1:
                return seen[-1]
            time.sleep(_POLL_S)
        raise DeviceError(
            "the automatic focus did not come to rest in time: is the board lit and in the picture?"
        )

    def _change(self, wanted: Settings, deadline_s: float) -> Settings:
        if not self.supported:
            raise DeviceRefused(NO_SETTINGS)
        before = self.read(deadline_s)
        if unknown := [name for name in wanted if name not in before]:
            raise DeviceRefused(f"this firmware has no setting {', '.join(unknown)}")
        self._http.change({**before, **wanted}, deadline_s)
        got = self.read(deadline_s)
        for name, value in wanted.items():
            if got.get(name) != value:
                raise DeviceRefused(f"{name} set to {value}, the camera has {got.get(name)}")
        return got


def _checked(settings: Settings) -> Settings:
    for name in _NUMBERS:
        value = settings.get(name, 0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= _MOST:
            raise DeviceError(f"the camera's setting {name} is no number that it can have")
    for name in (*_AUTOS, "focusAuto"):
        if not isinstance(settings.get(name, False), bool):
            raise DeviceError(f"the camera's setting {name} is neither true nor false")
    return settings


def values_of(settings: Settings) -> dict[str, float]:
    """`exposure_s` and `gain_db` of raw settings; a key is absent where they do not say."""
    values = {}
    if "exposure" in settings:
        values["exposure_s"] = settings["exposure"] * 1e-6
    if settings.get("gain"):
        values["gain_db"] = 20 * math.log10(settings["gain"] / _UNIT_GAIN)
    return values


def _within(value: int, low: int, high: int, unit: str) -> int:
    if not low <= value <= high:
        raise DeviceRefused(f"{value} {unit} lies outside what the camera has: {low} to {high}")
    return value
