"""What every GenICam camera does alike, whatever carries its frames.

Armed once, triggered by software for each pose: restarting an acquisition for every picture costs
a tenth of a second each time and some transports lose the frames after a restart.
"""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TypeVar

from drivers.bounded import Bounded
from drivers.camera import FocusSetting, Frame
from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable
from drivers.genicam_open import GenICamOptions, OpenCamera
from drivers.genicam_pixels import require_known
from drivers.genicam_session import Session
from drivers.untried import warn_untried

__all__ = ["GenICamCamera", "GenICamOptions"]

_log = logging.getLogger(__name__)
_MARGIN_S = 0.25
T = TypeVar("T")


class GenICamCamera(ABC):
    """A camera behind a `Session`; see `drivers.camera.Camera` for what its calls do.

    A camera that is lost raises `DeviceUnreachable` until `connect` is called again, which opens
    it anew with the exposure, gain and focus position it had.
    """

    tried_on_hardware = False
    tried_on = "a simulated camera"

    def __init__(self, device: str, options: GenICamOptions | None = None) -> None:
        self.device = device
        self.options = options or GenICamOptions()
        require_known(self.options.pixel_format)
        self._bounded = Bounded(device)
        self._now: OpenCamera | None = None
        self._wanted = {"exposure_s": self.options.exposure_s, "gain_db": self.options.gain_db}
        self._focus_wanted: FocusSetting | None = None

    @abstractmethod
    def _open(self) -> Session:
        """Open the camera's transport; called in the thread that will use it."""

    @property
    def capabilities(self) -> frozenset[str]:
        """What this camera has of `exposure`, `gain`, `focus` and `software_trigger`."""
        return self._require_open().capabilities

    def connect(self) -> None:
        """Open (or, after a loss, reopen), switch every automatism off, arm.

        Raises `DeviceUnreachable` or `DeviceRefused`.
        """
        if not self.tried_on_hardware:
            warn_untried(self.device, self.tried_on, "Look at the first pictures before a run.")
        former, self._now = self._now, None
        given_up = threading.Event()
        try:
            self._now = self._bounded.call(
                lambda: self._reopened(former, given_up), self.options.connect_timeout_s, "open"
            )
        except DeviceUnreachable:
            given_up.set()
            raise

    def configure(
        self, *, exposure_s: float | None = None, gain_db: float | None = None
    ) -> Mapping[str, float]:
        """Set exposure and gain; returns both as the camera then has them."""
        got = self._ask(
            lambda camera: camera.configure(exposure_s, gain_db),
            self.options.setting_timeout_s,
            "exposure and gain",
        )
        asked = {"exposure_s": exposure_s, "gain_db": gain_db}
        self._wanted |= {name: value for name, value in asked.items() if value is not None}
        return got

    def focus(self, setting: FocusSetting) -> float | None:
        """Focus, wait until the lens is ready; returns its position in steps, None if unknown."""
        wait_s = self.options.focus_timeout_s + self.options.setting_timeout_s
        reached = self._ask(lambda camera: camera.focus(setting), wait_s, "focus")
        self._focus_wanted = None if reached is None else FocusSetting("position", reached)
        return reached

    def grab(self, timeout_s: float) -> Frame:
        """Trigger and return that frame; one that comes incomplete is taken again in the time.

        Raises
        ------
        DeviceRefused
            The exposure does not fit into `timeout_s`.
        FrameMissing
            No whole frame came in time.
        DeviceUnreachable
            The camera is lost; `connect` reopens it.
        """
        exposure_s = self._require_open().values.get("exposure_s", 0.0)
        margin_s = min(_MARGIN_S, 0.3 * timeout_s)
        if exposure_s >= timeout_s - margin_s:
            raise DeviceRefused(
                f"{self.device}: an exposure of {exposure_s:g} s does not fit into a time-out of "
                f"{timeout_s:g} s; give more time or expose less"
            )
        deadline_s = time.monotonic() + timeout_s - margin_s
        return self._ask(lambda camera: camera.grab(deadline_s), timeout_s, "grab")

    def close(self) -> None:
        """Stop the stream and let go of the camera. Idempotent, never raises."""
        former, self._now = self._now, None
        if former is not None:
            try:
                self._bounded.call(former.close, self.options.setting_timeout_s, "close")
            except DeviceUnreachable as error:
                _log.warning("%s", error)
        self._bounded.close()

    def _require_open(self) -> OpenCamera:
        if self._now is None:
            raise DeviceUnreachable(f"{self.device}: not connected")
        if self._now.lost:
            raise DeviceUnreachable(
                f"{self.device}: the connection was lost; check its power and cable, "
                "then connect again"
            )
        return self._now

    def _reopened(self, former: OpenCamera | None, given_up: threading.Event) -> OpenCamera:
        if former is not None:
            former.close()
        try:
            camera = OpenCamera(
                self.device, self._open(), self.options, self._wanted, self._focus_wanted
            )
        except DeviceRefused as error:
            raise self._named(error) from None
        if given_up.is_set():
            camera.close()
        return camera

    def _ask(self, job: Callable[[OpenCamera], T], timeout_s: float, what: str) -> T:
        camera = self._require_open()
        return self._bounded.call(lambda: self._noticing(camera, job), timeout_s, what)

    def _noticing(self, camera: OpenCamera, job: Callable[[OpenCamera], T]) -> T:
        try:
            return job(camera)
        except DeviceError as error:
            if isinstance(error, DeviceUnreachable):
                camera.note_lost()
            raise self._named(error) from None

    def _named(self, error: DeviceError) -> DeviceError:
        return error if self.device in str(error) else type(error)(f"{self.device}: {error}")
