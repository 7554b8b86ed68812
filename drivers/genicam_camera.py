"""What every GenICam camera does alike, whatever carries its frames.

Armed once, triggered by software for each pose: restarting an acquisition for every picture costs
a tenth of a second each time and some transports lose the frames after a restart.
"""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from drivers.bounded import Bounded
from drivers.camera import FocusSetting, Frame
from drivers.errors import DeviceRefused, DeviceUnreachable, FrameLost
from drivers.focus import FocusControl, FocusNames
from drivers.genicam_pixels import decode, require_known
from drivers.genicam_session import IncompleteFrame, RawFrame, Session
from drivers.genicam_settings import CameraSettings, FeatureNames
from drivers.untried import warn_untried

_log = logging.getLogger(__name__)
_SLICE_S = 0.1
_MARGIN_S = 0.25
T = TypeVar("T")


@dataclass(frozen=True)
class GenICamOptions:
    """How a GenICam camera is used.

    Attributes
    ----------
    exposure_s, gain_db:
        Set when connecting, and again after a reconnection; None leaves the camera's own.
    pixel_format:
        One of `drivers.genicam_pixels.PIXEL_FORMATS`.
    features:
        Further features to set when connecting, by name.
    software_trigger:
        False for a camera that cannot be triggered and streams by itself.
    stale_frames:
        Without a trigger: how many newly arrived frames may have been exposed before the grab was
        called and are dropped; two where exposure and transfer overlap.
    names, focus_names:
        The camera's names for its features.
    connect_timeout_s, setting_timeout_s, focus_timeout_s:
        The longest that connecting, a setting, and the lens may take.
    """

    exposure_s: float | None = None
    gain_db: float | None = None
    pixel_format: str = "Mono8"
    features: Mapping[str, float | str] = field(default_factory=dict)
    software_trigger: bool = True
    stale_frames: int = 2
    names: FeatureNames = field(default_factory=FeatureNames)
    focus_names: FocusNames = field(default_factory=FocusNames)
    connect_timeout_s: float = 20.0
    setting_timeout_s: float = 3.0
    focus_timeout_s: float = 20.0


@dataclass
class _Open:
    session: Session
    settings: CameraSettings
    focus: FocusControl


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
        self._now: _Open | None = None
        self._wanted = {"exposure_s": self.options.exposure_s, "gain_db": self.options.gain_db}
        self._values: dict[str, float] = {}
        self._focus_wanted: FocusSetting | None = None
        self._lost = False
        self._unanswered_trigger = False

    @abstractmethod
    def _open(self) -> Session:
        """Open the camera's transport; called in the thread that will use it."""

    @property
    def capabilities(self) -> frozenset[str]:
        """What this camera can do of `exposure`, `gain`, `focus` and `software_trigger`."""
        opened = self._require_open()
        found = set(opened.settings.capabilities)
        found |= {"focus"} if opened.focus.available else set()
        found |= {"software_trigger"} if self.options.software_trigger else set()
        return frozenset(found)

    def connect(self) -> None:
        """Open (or, after a loss, reopen), switch every automatism off, arm.

        Raises `DeviceUnreachable` or `DeviceRefused`.
        """
        if not self.tried_on_hardware:
            warn_untried(self.device, self.tried_on, "Look at the first pictures before a run.")
        self._ask(self._connect, "open", self.options.connect_timeout_s)

    def configure(
        self, *, exposure_s: float | None = None, gain_db: float | None = None
    ) -> Mapping[str, float]:
        """Set exposure and gain; returns both as the camera then has them."""
        return self._ask(lambda: self._configure(exposure_s, gain_db), "exposure and gain")

    def focus(self, setting: FocusSetting) -> float | None:
        """Focus, wait until the lens is ready; returns its position in steps, None if unknown."""
        wait_s = self.options.focus_timeout_s + self.options.setting_timeout_s
        return self._ask(lambda: self._focus(setting), "focus", wait_s)

    def grab(self, timeout_s: float) -> Frame:
        """Trigger and return that frame; one that comes incomplete is taken again in the time.

        Raises
        ------
        DeviceRefused
            The exposure does not fit into `timeout_s`.
        FrameLost
            No whole frame came in time.
        DeviceUnreachable
            The camera is lost; `connect` reopens it.
        """
        exposure_s = self._values.get("exposure_s", 0.0)
        margin_s = min(_MARGIN_S, 0.3 * timeout_s)
        if exposure_s >= timeout_s - margin_s:
            raise DeviceRefused(
                f"{self.device}: an exposure of {exposure_s:g} s does not fit into a time-out of "
                f"{timeout_s:g} s; give more time or expose less"
            )
        deadline_s = time.monotonic() + timeout_s - margin_s
        return self._ask(lambda: self._grab(deadline_s), "grab", timeout_s)

    def close(self) -> None:
        """Stop the stream and let go of the camera. Idempotent, never raises."""
        try:
            self._bounded.call(self._drop, self.options.setting_timeout_s, "close")
        except DeviceUnreachable as error:
            _log.warning("%s", error)
        self._bounded.close()

    def _ask(self, job: Callable[[], T], what: str, timeout_s: float | None = None) -> T:
        wait_s = timeout_s or self.options.setting_timeout_s
        return self._bounded.call(lambda: self._noticing(job), wait_s, what)

    def _noticing(self, job: Callable[[], T]) -> T:
        try:
            return job()
        except DeviceUnreachable:
            self._lost = True
            raise
        except DeviceRefused as error:
            if self.device in str(error):
                raise
            raise DeviceRefused(f"{self.device}: {error}") from None

    def _require_open(self) -> _Open:
        if self._now is None:
            raise DeviceUnreachable(f"{self.device}: not connected")
        if self._lost or self._now.session.lost:
            raise DeviceUnreachable(
                f"{self.device}: the connection was lost; check its power and cable, "
                "then connect again"
            )
        return self._now

    def _connect(self) -> None:
        self._drop()
        session = self._open()
        try:
            opened = self._prepared(session)
        except BaseException:
            session.close(polite=True)
            raise
        self._now = opened

    def _prepared(self, session: Session) -> _Open:
        options = self.options
        settings = CameraSettings(session.features, options.names)
        settings.prepare(options.pixel_format, options.features)
        self._values = settings.set(self._wanted["exposure_s"], self._wanted["gain_db"])
        self._set_trigger(session)
        focus = FocusControl(session.features, options.focus_names, options.focus_timeout_s)
        if self._focus_wanted and focus.available:
            focus.set(self._focus_wanted)
        session.arm()
        return _Open(session, settings, focus)

    def _set_trigger(self, session: Session) -> None:
        on = {"TriggerSource": "Software", "TriggerMode": "On"}
        wanted = on if self.options.software_trigger else {"TriggerMode": "Off"}
        if self.options.software_trigger and not session.features.has("TriggerSoftware"):
            raise DeviceRefused(
                f"{self.device}: the camera has no TriggerSoftware; "
                "say software_trigger: false for one that streams by itself"
            )
        for name, value in {
            "AcquisitionMode": "Continuous",
            "TriggerSelector": "FrameStart",
            **wanted,
        }.items():
            if session.features.has(name) and session.features.read(name) != value:
                session.features.write(name, value)

    def _drop(self) -> None:
        opened, self._now = self._now, None
        if opened:
            opened.session.close(polite=not (self._lost or opened.session.lost))
        self._lost = self._unanswered_trigger = False

    def _configure(self, exposure_s: float | None, gain_db: float | None) -> dict[str, float]:
        self._values = self._require_open().settings.set(exposure_s, gain_db)
        asked = {"exposure_s": exposure_s, "gain_db": gain_db}
        self._wanted |= {name: value for name, value in asked.items() if value is not None}
        return self._values

    def _focus(self, setting: FocusSetting) -> float | None:
        reached = self._require_open().focus.set(setting)
        self._focus_wanted = (
            FocusSetting("hold") if reached is None else FocusSetting("position", reached)
        )
        return reached

    def _grab(self, deadline_s: float) -> Frame:
        session = self._require_open().session
        if self._unanswered_trigger:
            session.arm()
            self._unanswered_trigger = False
        incomplete: list[str] = []
        while True:
            session.flush()
            sent_s = time.monotonic()
            self._trigger(session, deadline_s)
            acknowledged_s = time.monotonic()
            try:
                raw = self._fetch(session, deadline_s)
                image = decode(raw.data, raw.width, raw.height, raw.pixel_format)
                break
            except (IncompleteFrame, ValueError) as error:
                _log.info("%s: %s; triggering again", self.device, error)
                incomplete.append(str(error))
        middle_s = (sent_s + acknowledged_s + self._values.get("exposure_s", 0.0)) / 2
        return Frame(
            image=image,
            host_t_s=middle_s,
            device_t_s=None if raw.device_timestamp_ns is None else raw.device_timestamp_ns * 1e-9,
            exposure_s=self._values.get("exposure_s"),
            gain_db=self._values.get("gain_db"),
            focus_position=self._require_open().focus.position(),
            temperature_c=self._require_open().settings.temperature_c(),
            raw={
                **raw.raw,
                "trigger_sent_s": sent_s,
                "trigger_acknowledged_s": acknowledged_s,
                "arrived_s": time.monotonic(),
                "device_timestamp_ns": raw.device_timestamp_ns,
                "pixel_format": raw.pixel_format,
                "incomplete": incomplete,
            },
        )

    def _trigger(self, session: Session, deadline_s: float) -> None:
        self._unanswered_trigger = True
        if self.options.software_trigger:
            session.features.execute("TriggerSoftware")
            return
        for _ in range(self.options.stale_frames):
            self._fetch(session, deadline_s)

    def _fetch(self, session: Session, deadline_s: float) -> RawFrame:
        while (left_s := deadline_s - time.monotonic()) > 0:
            raw = session.fetch(min(left_s, _SLICE_S))
            if raw is not None:
                self._unanswered_trigger = False
                return raw
            self._require_open()
        raise FrameLost(
            f"{self.device}: no frame came after the trigger; if this happens with every trigger, "
            "no packet of this size may pass the network (MTU), or a firewall drops the stream"
        )
