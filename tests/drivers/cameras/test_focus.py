"""The focus control against features that behave as vendors' do."""

from __future__ import annotations

import threading

import pytest

from drivers.camera import FocusSetting
from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable
from drivers.focus import FocusControl, FocusNames

BASLER = FocusNames(controller="Optic1")
VENDOR = FocusNames(position="LensPosition", auto="LensAutoFocus", status=("LensState",))


class Lens:
    """A lens that is busy for so many readings of its status after every order."""

    def __init__(
        self, values: dict[str, float | str], busy: str = "Busy", ready: str = "Ready"
    ) -> None:
        self.values = values
        self.orders: list[tuple[str, object]] = []
        self.busy_for, self.busy_left = 3, 0
        self.words = busy, ready
        self.sticks_at: float | None = None

    def has(self, name: str) -> bool:
        return name in self.values

    def read(self, name: str) -> float | str:
        if name.endswith(("Status", "State")) and self.values[name] != "NotInitialized":
            self.busy_left -= 1
            if self.values[name] == "Error":
                return "Error"
            return self.words[0] if self.busy_left >= 0 else self.words[1]
        return self.values[name]

    def write(self, name: str, value: float | str) -> None:
        self.orders.append((name, value))
        stuck = self.sticks_at is not None and isinstance(value, float)
        self.values[name] = self.sticks_at if stuck and self.sticks_at is not None else value
        self.busy_left = self.busy_for
        if value == "Once":
            self.values[name] = "Off"

    def execute(self, name: str) -> None:
        self.orders.append((name, None))
        for status in ("FocusStatus", "OpticControllerStatus"):
            if status in self.values:
                self.values[status] = "Ready"


def sfnc_lens() -> Lens:
    return Lens(
        {
            "OpticControllerSelector": "OpticController0",
            "OpticControllerInitialize": 0,
            "FocusStatus": "NotInitialized",
            "FocusAuto": "Continuous",
            "FocusStepper": 10.0,
        }
    )


def test_an_uninitialised_lens_is_initialised_and_its_automatic_switched_off_first() -> None:
    lens = sfnc_lens()
    assert FocusControl(lens, FocusNames(), 2.0).set(FocusSetting("position", 55.0)) == 55.0
    assert [name for name, _ in lens.orders] == [
        "OpticControllerInitialize",
        "FocusAuto",
        "FocusStepper",
    ]


def test_the_position_is_read_only_when_the_lens_is_ready() -> None:
    lens = sfnc_lens()
    lens.busy_for = 20
    FocusControl(lens, FocusNames(), 2.0).set(FocusSetting("position", 55.0))
    assert lens.busy_left < 0


def test_basler_names_its_controller_and_its_states_otherwise() -> None:
    lens = Lens(
        {"OpticControllerSelector": "Optic0", "OpticControllerStatus": "x", "FocusStepper": 1.0},
        busy="Busy",
        ready="NotBusy",
    )
    assert FocusControl(lens, BASLER, 2.0).set(FocusSetting("position", 9.0)) == 9.0
    assert lens.orders[0] == ("OpticControllerSelector", "Optic1")


def test_a_vendors_own_names_work() -> None:
    lens = Lens({"LensPosition": 3.0, "LensAutoFocus": "Off", "LensState": "x"})
    control = FocusControl(lens, VENDOR, 2.0)
    assert control.set(FocusSetting("auto")) == 3.0
    assert control.set(FocusSetting("position", 8.0)) == 8.0
    assert control.position() == 8.0


def test_a_lens_that_stops_elsewhere_is_refused() -> None:
    lens = sfnc_lens()
    lens.sticks_at = 54.0
    with pytest.raises(DeviceRefused, match=r"set to 55.0, the camera has 54.0"):
        FocusControl(lens, FocusNames(), 2.0).set(FocusSetting("position", 55.0))


def test_a_lens_that_never_gets_ready_is_an_error() -> None:
    lens = sfnc_lens()
    lens.busy_for = 10**9
    with pytest.raises(DeviceError, match=r"not ready after 0.1 s"):
        FocusControl(lens, FocusNames(), 0.1).set(FocusSetting("position", 55.0))


def test_a_camera_that_was_off_meanwhile_is_lost_and_not_waited_for() -> None:
    lens = sfnc_lens()
    lens.busy_for = 10**9
    control = FocusControl(lens, FocusNames(), 60.0)
    threading.Timer(0.2, lens.values.update, ({"FocusStatus": "NotInitialized"},)).start()
    with pytest.raises(DeviceUnreachable, match="lost its reference"):
        control.set(FocusSetting("position", 55.0))


def test_a_lens_error_is_refused_in_words() -> None:
    lens = sfnc_lens()
    lens.values["FocusStatus"] = "Error"
    with pytest.raises(DeviceRefused, match="lens reports 'Error'"):
        FocusControl(lens, FocusNames(), 0.5).set(FocusSetting("position", 55.0))


def test_a_camera_without_a_lens_holds_and_refuses_the_rest() -> None:
    control = FocusControl(Lens({}), FocusNames(), 0.1)
    assert control.set(FocusSetting("hold")) is None
    assert control.position() is None
    for setting in (FocusSetting("auto"), FocusSetting("position", 1.0)):
        with pytest.raises(DeviceRefused, match="cell file"):
            control.set(setting)
