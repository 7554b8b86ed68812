"""Settings of a GenICam camera: which feature means what, autos off, exposure and gain.

Default names are those of EMVA's Standard Features Naming Convention (SFNC) 2.7.1; older and
vendor's names go into `FeatureNames`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from drivers.errors import DeviceRefused
from drivers.genicam_session import Features

_RELATIVE_TOLERANCE = 0.01
_GAIN_TOLERANCE_DB = 0.1
_EXPOSURE_STEP_S = 50e-6


@dataclass(frozen=True)
class FeatureNames:
    """Names of the features that the drivers use; the first of a tuple that exists is taken.

    Attributes
    ----------
    exposure, exposure_unit_s:
        Exposure time and the seconds in one of its units (SFNC: microseconds).
    gain, gain_is_factor:
        Gain, in dB, or as a linear factor where that is true.
    autos:
        Enumerations that are set to `Off` where they exist.
    full_frame:
        (feature, its value), numbers or the name of a feature that holds the number; written in
        this order where they exist, so that every picture is the whole sensor.
    """

    exposure: tuple[str, ...] = ("ExposureTime", "ExposureTimeAbs")
    exposure_unit_s: float = 1e-6
    gain: tuple[str, ...] = ("Gain",)
    gain_is_factor: bool = False
    temperature: str = "DeviceTemperature"
    autos: tuple[str, ...] = (
        "ExposureAuto",
        "GainAuto",
        "BlackLevelAuto",
        "BalanceWhiteAuto",
        "FocusAuto",
    )
    full_frame: tuple[tuple[str, int | str], ...] = (
        ("BinningHorizontal", 1),
        ("BinningVertical", 1),
        ("DecimationHorizontal", 1),
        ("DecimationVertical", 1),
        ("OffsetX", 0),
        ("OffsetY", 0),
        ("Width", "WidthMax"),
        ("Height", "HeightMax"),
        ("Width", "SensorWidth"),
        ("Height", "SensorHeight"),
    )


class CameraSettings:
    """Exposure, gain and the autos of one open camera, each set and read back."""

    def __init__(self, features: Features, names: FeatureNames) -> None:
        self._features, self._names = features, names
        self._exposure = _first(features, names.exposure)
        self._gain = _first(features, names.gain)

    @property
    def capabilities(self) -> frozenset[str]:
        """Which of `exposure` and `gain` the camera has."""
        found = {"exposure": self._exposure, "gain": self._gain}
        return frozenset(name for name, feature in found.items() if feature)

    def prepare(self, pixel_format: str, features: Mapping[str, float | str]) -> None:
        """Autos off, whole sensor, pixel format, then `features` by name, each read back.

        Raises `DeviceRefused` where the camera does not have what was set.
        """
        for name in self._names.autos:
            if self._features.has(name) and self._features.read(name) != "Off":
                self._set(name, "Off")
        for name, value in self._names.full_frame:
            self._set_full_frame(name, value)
        for name, wanted in {"PixelFormat": pixel_format, **features}.items():
            self._set(name, wanted)

    def set(self, exposure_s: float | None, gain_db: float | None) -> dict[str, float]:
        """Set what is given; returns `exposure_s` and `gain_db` as the camera then has them."""
        if exposure_s is not None:
            self._set_exposure(exposure_s)
        if gain_db is not None:
            self._set_gain(gain_db)
        return self.read()

    def read(self) -> dict[str, float]:
        """`exposure_s` and `gain_db` as the camera has them; a key is absent where it has none."""
        values = {}
        if self._exposure:
            values["exposure_s"] = self._number(self._exposure) * self._names.exposure_unit_s
        if self._gain:
            values["gain_db"] = self._to_db(self._number(self._gain))
        return values

    def temperature_c(self) -> float | None:
        """The camera's temperature, or None."""
        name = self._names.temperature
        return self._number(name) if self._features.has(name) else None

    def _set_exposure(self, exposure_s: float) -> None:
        if not self._exposure:
            raise DeviceRefused(_missing("exposure", self._names.exposure))
        self._features.write(self._exposure, exposure_s / self._names.exposure_unit_s)
        got = self.read()["exposure_s"]
        if abs(got - exposure_s) > max(_RELATIVE_TOLERANCE * exposure_s, _EXPOSURE_STEP_S):
            raise DeviceRefused(f"exposure set to {exposure_s:g} s, the camera has {got:g} s")

    def _set_gain(self, gain_db: float) -> None:
        if not self._gain:
            raise DeviceRefused(_missing("gain", self._names.gain))
        value = 10 ** (gain_db / 20) if self._names.gain_is_factor else gain_db
        self._features.write(self._gain, value)
        got = self.read()["gain_db"]
        if abs(got - gain_db) > _GAIN_TOLERANCE_DB:
            raise DeviceRefused(f"gain set to {gain_db:g} dB, the camera has {got:g} dB")

    def _to_db(self, value: float) -> float:
        return 20 * math.log10(value) if self._names.gain_is_factor else value

    def _number(self, name: str) -> float:
        return float(self._features.read(name))

    def _set(self, name: str, value: float | str) -> None:
        self._features.write(name, value)
        got = self._features.read(name)
        if not _alike(got, value):
            raise DeviceRefused(f"{name} set to {value}, the camera has {got}")

    def _set_full_frame(self, name: str, value: int | str) -> None:
        if not self._features.has(name):
            return
        if isinstance(value, str) and not self._features.has(value):
            return
        wanted = self._number(value) if isinstance(value, str) else float(value)
        if self._number(name) != wanted:
            self._set(name, wanted)


def _first(features: Features, names: tuple[str, ...]) -> str | None:
    return next((name for name in names if features.has(name)), None)


def _alike(got: float | str, wanted: float | str) -> bool:
    if isinstance(got, str) or isinstance(wanted, str):
        return got == wanted
    return math.isclose(got, wanted, rel_tol=_RELATIVE_TOLERANCE, abs_tol=1e-9)


def _missing(what: str, names: tuple[str, ...]) -> str:
    return (
        f"the camera has no {what} feature named {' or '.join(names)}; "
        "leave it out of the plan, or give the camera's own name for it in the cell file"
    )
