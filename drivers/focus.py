"""Motorised focus through GenICam features: set, poll until ready, read back.

Names and the order of steps follow SFNC 2.7.1 chapter 23, `OpticControl`: choose the controller,
initialise it if it asks for that, automatic focus off, position, status until ready. Vendors whose
names differ (Basler calls the controller `Optic1` and the ready state `NotBusy`) fit in by
`FocusNames`.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from drivers.camera import FocusSetting
from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable
from drivers.genicam_session import Features

MODES = ("auto", "hold", "position")
_POLL_S = 0.01
_READY_IN_A_ROW = 2  # a lens may still say ready in the instant after the order


@dataclass(frozen=True)
class FocusNames:
    """Names of the focus features; the first of a tuple that exists is taken.

    Attributes
    ----------
    selector, controller:
        Feature and entry that choose the lens controller; `controller` None leaves it as it is.
    ready, uninitialised, failed:
        Entries of the status that mean so; any other is waited for.
    """

    selector: str = "OpticControllerSelector"
    controller: str | None = None
    position: str = "FocusStepper"
    auto: str = "FocusAuto"
    auto_off: str = "Off"
    auto_once: str = "Once"
    status: tuple[str, ...] = ("FocusStatus", "OpticControllerStatus")
    initialise: tuple[str, ...] = ("OpticControllerInitialize", "FocusInitialize")
    ready: frozenset[str] = frozenset({"Ready", "NotBusy"})
    uninitialised: frozenset[str] = frozenset({"NotInitialized"})
    failed: frozenset[str] = frozenset({"Error", "NotConnected", "NotSupported"})


class FocusControl:
    """The focus of one open camera.

    Parameters
    ----------
    timeout_s:
        How long the lens may take to become ready.
    """

    def __init__(self, features: Features, names: FocusNames, timeout_s: float) -> None:
        self._features, self._names, self._timeout_s = features, names, timeout_s
        self._status = next((name for name in names.status if features.has(name)), None)

    @property
    def available(self) -> bool:
        """Whether the camera has a focus position."""
        return self._features.has(self._names.position)

    def position(self) -> float | None:
        """The position read from the camera, in its own steps, or None where it states none."""
        return float(self._features.read(self._names.position)) if self.available else None

    def set(self, setting: FocusSetting) -> float | None:
        """Focus, wait until ready and return the position read back.

        Raises
        ------
        DeviceRefused
            The mode is unknown, the camera cannot do it, or the lens reports an error.
        DeviceUnreachable
            The lens lost its reference: the camera was off meanwhile.
        DeviceError
            The lens was not ready in time.
        """
        if setting.mode not in MODES:
            raise DeviceRefused(f"focus mode '{setting.mode}' is none of {', '.join(MODES)}")
        if setting.mode == "hold" and not self.available:
            return None
        self._require(setting)
        self._prepare()
        if setting.mode == "auto":
            self._features.write(self._names.auto, self._names.auto_once)
        elif setting.position is not None:
            self._features.write(self._names.position, setting.position)
        if setting.mode != "hold" or self._busy():
            self._wait_until_ready(initialised=True)
        return self._confirmed(setting)

    def _require(self, setting: FocusSetting) -> None:
        if setting.mode == "position" and setting.position is None:
            raise DeviceRefused("focus mode 'position' needs a position, in the lens's steps")
        needed = self._names.auto if setting.mode == "auto" else self._names.position
        if not self._features.has(needed):
            raise DeviceRefused(
                f"the camera has no feature {needed} for focus mode '{setting.mode}'; use 'hold', "
                "or give the camera's own name for it in the cell file"
            )

    def _prepare(self) -> None:
        names = self._names
        if names.controller and self._features.has(names.selector):
            self._features.write(names.selector, names.controller)
        if self._state() in names.uninitialised:
            for command in names.initialise:
                if self._features.has(command):
                    self._features.execute(command)
            self._wait_until_ready()
        if self._features.has(names.auto) and self._features.read(names.auto) != names.auto_off:
            self._features.write(names.auto, names.auto_off)

    def _state(self) -> str | None:
        return str(self._features.read(self._status)) if self._status else None

    def _busy(self) -> bool:
        state = self._state()
        if state in self._names.failed:
            raise DeviceRefused(f"the lens reports '{state}': check its connection and supply")
        auto = self._names.auto
        focusing = self._features.has(auto) and self._features.read(auto) == self._names.auto_once
        return focusing or (state is not None and state not in self._names.ready)

    def _wait_until_ready(self, *, initialised: bool = False) -> None:
        deadline_s = time.monotonic() + self._timeout_s
        in_a_row = 0 if self._busy() else 1
        while in_a_row < _READY_IN_A_ROW:
            time.sleep(_POLL_S)
            in_a_row = 0 if self._busy() else in_a_row + 1
            if initialised and self._state() in self._names.uninitialised:
                raise DeviceUnreachable(
                    "the lens has lost its reference, as after a loss of power; check its supply"
                )
            if time.monotonic() > deadline_s:
                raise DeviceError(
                    f"the lens was not ready after {self._timeout_s:g} s: check its connection and"
                    " supply"
                )

    def _confirmed(self, setting: FocusSetting) -> float | None:
        got = self.position()
        if setting.mode == "position" and got != setting.position:
            raise DeviceRefused(f"focus set to {setting.position}, the camera has {got}")
        return got
