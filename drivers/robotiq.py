"""Robotiq's wrist camera, over the HTTP server of its URCap on the robot's controller."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.bounded import Bounded
from drivers.camera import FocusSetting, Frame
from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable, FrameMissing
from drivers.robotiq_http import PORT, RobotiqHttp
from drivers.robotiq_settings import NO_SETTINGS, RobotiqSettings, values_of
from drivers.untried import warn_untried

_log = logging.getLogger(__name__)
_CONNECT_S = 10.0
_SETTING_S = 5.0
_MARGIN_S = 0.25
_REPEATED_PAUSE_S = 0.005
T = TypeVar("T")


class RobotiqCamera:
    """A camera without a trigger, whose server gives its newest picture.

    A picture that equals the one before, byte for byte, is the same picture and is not used again;
    and the first new ones may have been exposed before `grab` was called, and are dropped.

    Parameters
    ----------
    address:
        The robot's address, with `:port` where it is not 4242.
    exposure_s, gain_db:
        Set when connecting; None leaves the camera's own.
    display_size:
        (width, height) to ask for; None takes the pictures as they come.
    stale_pictures:
        How many new pictures are dropped before one is used.
    """

    tried_on_hardware = False

    def __init__(
        self,
        address: str,
        *,
        exposure_s: float | None = None,
        gain_db: float | None = None,
        display_size: tuple[int, int] | None = None,
        stale_pictures: int = 2,
    ) -> None:
        host, _, port = address.partition(":")
        self.device = f"Robotiq camera {address}"
        self._where = host, int(port or PORT)
        self._wanted = {"exposure_s": exposure_s, "gain_db": gain_db}
        self._display_size, self._stale = display_size, stale_pictures
        self._bounded = Bounded(self.device)
        self._http: RobotiqHttp | None = None
        self._size: tuple[int, int] | None = None
        self._last = b""

    @property
    def capabilities(self) -> frozenset[str]:
        """What this firmware can do of `exposure`, `gain` and `focus`."""
        supported = self._http is not None and self._settings.supported
        return frozenset({"exposure", "gain", "focus"} if supported else ())

    def connect(self) -> None:
        """Open (or reopen), learn the picture's size and whether settings can be had, autos off."""
        warn_untried(self.device, "a simulated server", "Look at the first pictures before a run.")
        self._ask(self._connect, _CONNECT_S, "open")

    def configure(
        self, *, exposure_s: float | None = None, gain_db: float | None = None
    ) -> Mapping[str, float]:
        """Set exposure and gain; returns both as the camera then has them."""
        return self._ask(lambda end: self._configure(exposure_s, gain_db, end), _SETTING_S, "set")

    def focus(self, setting: FocusSetting) -> float | None:
        """Focus and lock; None where the firmware does not report, and then nothing is locked."""
        return self._ask(lambda end: self._focus(setting, end), 2 * _SETTING_S, "focus")

    def grab(self, timeout_s: float) -> Frame:
        """A picture exposed after this call; raises `FrameMissing` when none comes.

        Raises
        ------
        DeviceRefused
            The picture's size or the locked focus changed during the run.
        """
        return self._ask(self._grab, timeout_s, "grab")

    def close(self) -> None:
        """Close the connection. Idempotent, never raises."""
        try:
            self._bounded.call(self._drop, _SETTING_S, "close")
        except DeviceUnreachable as error:
            _log.warning("%s", error)
        self._bounded.close()

    def _ask(self, job: Callable[[float], T], timeout_s: float, what: str) -> T:
        deadline_s = time.monotonic() + timeout_s - min(_MARGIN_S, 0.3 * timeout_s)
        return self._bounded.call(lambda: self._named(job, deadline_s), timeout_s, what)

    def _named(self, job: Callable[[float], T], deadline_s: float) -> T:
        try:
            return job(deadline_s)
        except DeviceError as error:
            if self.device in str(error):
                raise
            raise type(error)(f"{self.device}: {error}") from None

    def _connect(self, deadline_s: float) -> None:
        self._drop()
        http = RobotiqHttp(*self._where)
        self._settings = RobotiqSettings(http)
        self._settings.probe(deadline_s)
        self._http = http
        if not self._settings.supported:
            _log.warning("%s: %s; its focus may move by itself", self.device, NO_SETTINGS)
        if any(value is not None for value in self._wanted.values()):
            self._settings.set(**self._wanted, deadline_s=deadline_s)
        self._learn_size(http, deadline_s)

    def _learn_size(self, http: RobotiqHttp, deadline_s: float) -> None:
        if self._display_size:
            http.set_display_size(*self._display_size, deadline_s)
        self._size = None
        while True:
            size = _size_of(self._decoded(http.picture(deadline_s)))
            if self._display_size in (None, size):
                break
            if time.monotonic() + 0.2 > deadline_s:
                raise DeviceRefused(f"size {self._display_size} was asked for, {size} comes")
            time.sleep(0.1)
        self._size = size

    def _drop(self) -> None:
        http, self._http = self._http, None
        if http:
            http.close()

    def _require_open(self) -> RobotiqHttp:
        if self._http is None:
            raise DeviceUnreachable(f"{self.device}: not connected")
        return self._http

    def _configure(
        self, exposure_s: float | None, gain_db: float | None, deadline_s: float
    ) -> dict[str, float]:
        self._require_open()
        got = self._settings.set(exposure_s, gain_db, deadline_s)
        asked = {"exposure_s": exposure_s, "gain_db": gain_db}
        self._wanted |= {name: value for name, value in asked.items() if value is not None}
        return got

    def _focus(self, setting: FocusSetting, deadline_s: float) -> float | None:
        self._require_open()
        reached = self._settings.focus(setting, deadline_s)
        if reached is None:
            _log.warning("%s: the focus is not locked: %s", self.device, NO_SETTINGS)
        return reached

    def _grab(self, deadline_s: float) -> Frame:
        http = self._require_open()
        for _ in range(self._stale):
            self._new_picture(http, deadline_s)
        asked_s = time.monotonic()
        body = self._new_picture(http, deadline_s)
        arrived_s = time.monotonic()
        image = self._decoded(body)
        if _size_of(image) != self._size:
            raise DeviceRefused(
                f"the picture's size changed from {self._size} to {_size_of(image)} during the "
                "run; somebody else changes the display size, start again when that is over"
            )
        settings = self._settings.read(deadline_s)
        values = values_of(settings)
        position = settings.get("focus")
        return Frame(
            image=image,
            host_t_s=(asked_s + arrived_s) / 2,
            exposure_s=values.get("exposure_s"),
            gain_db=values.get("gain_db"),
            focus_position=None if position is None else float(position),
            raw={
                "asked_s": asked_s,
                "arrived_s": arrived_s,
                "focus_locked": self._settings.focus_locked(settings),
                "settings": settings,
            },
        )

    def _new_picture(self, http: RobotiqHttp, deadline_s: float) -> bytes:
        lost = ""
        while time.monotonic() < deadline_s - 2 * _REPEATED_PAUSE_S:
            try:
                body = http.picture(deadline_s)
            except FrameMissing as error:
                lost = str(error)
                continue
            except DeviceUnreachable:
                if lost:
                    break  # it did answer before: the time has run out
                raise
            if body != self._last:
                self._last = body
                return body
            lost = f"{self.device}: the server only repeats its last picture"
            time.sleep(_REPEATED_PAUSE_S)
        raise FrameMissing(lost or f"{self.device}: no picture came in time")

    def _decoded(self, body: bytes) -> NDArray[np.generic]:
        image = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise FrameMissing(f"{self.device}: the picture cannot be decoded")
        return np.asarray(image)


def _size_of(image: NDArray[Any]) -> tuple[int, int]:
    return image.shape[1], image.shape[0]
