"""The device's side of a GenICam camera: what is done with an open session, in its one thread."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.camera import FocusSetting, Frame
from drivers.errors import DeviceRefused, DeviceUnreachable, FrameMissing
from drivers.focus import FocusControl, FocusNames
from drivers.genicam_pixels import decode
from drivers.genicam_session import IncompleteFrame, RawFrame, Session
from drivers.genicam_settings import CameraSettings, FeatureNames

_log = logging.getLogger(__name__)
_SLICE_S = 0.1
_OTHER_TRIGGERS = ("AcquisitionStart", "FrameBurstStart", "ExposureStart", "LineStart")


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
    patience_s:
        With a trigger: a frame that has not come so long after the end of its exposure is triggered
        again, while the grab's time-out lasts.
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
    patience_s: float = 1.0
    names: FeatureNames = field(default_factory=FeatureNames)
    focus_names: FocusNames = field(default_factory=FocusNames)
    connect_timeout_s: float = 20.0
    setting_timeout_s: float = 3.0
    focus_timeout_s: float = 20.0


@dataclass(frozen=True)
class _Taken:
    raw: RawFrame
    image: NDArray[np.generic]
    sent_s: float
    acknowledged_s: float
    arrived_s: float
    missed: list[str]


class OpenCamera:
    """An open camera with its settings made and its acquisition running.

    `capabilities` is what it has of `exposure`, `gain`, `focus` and `software_trigger`; `values`
    are exposure and gain as last read back.

    Raises `DeviceError` when the camera does not take the settings; the session is closed then.
    """

    def __init__(
        self,
        device: str,
        session: Session,
        options: GenICamOptions,
        wanted: Mapping[str, float | None],
        focus: FocusSetting | None,
    ) -> None:
        self._device, self._session, self._options = device, session, options
        self._lost = self._unanswered_trigger = False
        try:
            self._prepare(wanted, focus)
        except BaseException:
            session.close(polite=True)
            raise

    @property
    def lost(self) -> bool:
        """Whether the camera is gone or in other hands."""
        return self._lost or self._session.lost

    def note_lost(self) -> None:
        """It did not answer: nothing more is asked of it."""
        self._lost = True

    def configure(self, exposure_s: float | None, gain_db: float | None) -> dict[str, float]:
        """Set what is given; returns both as read back."""
        self.values = self._settings.set(exposure_s, gain_db)
        return self.values

    def focus(self, setting: FocusSetting) -> float | None:
        """Focus, wait, and return the position read back."""
        return self._focus.set(setting)

    def grab(self, deadline_s: float) -> Frame:
        """Trigger and return that frame; one that is missed is taken again in the time."""
        missed: list[str] = []
        while True:
            if self._unanswered_trigger:
                self._session.arm()  # its frame may still come, and must not be taken for the next
                self._unanswered_trigger = False
            try:
                return self._frame(self._take(deadline_s, missed))
            except (IncompleteFrame, ValueError, FrameMissing) as error:
                if time.monotonic() + self.values.get("exposure_s", 0.0) >= deadline_s:
                    raise self._lost_frame(missed, error) from None
                _log.info("%s: %s; triggering again", self._device, error)
                missed.append(str(error))

    def close(self) -> None:
        """Let go; a lost camera is not asked any more."""
        self._session.close(polite=not self.lost)

    def _prepare(self, wanted: Mapping[str, float | None], focus: FocusSetting | None) -> None:
        features, options = self._session.features, self._options
        if features.has("AcquisitionStop"):
            # a program that crashed leaves it running, and then it takes no settings
            features.execute("AcquisitionStop")
        self._settings = CameraSettings(features, options.names)
        self._settings.prepare(options.pixel_format, options.features)
        self.values = self._settings.set(wanted["exposure_s"], wanted["gain_db"])
        self._set_trigger()
        self._focus = FocusControl(features, options.focus_names, options.focus_timeout_s)
        if focus and self._focus.available:
            self._focus.set(focus)
        self.capabilities = self._found()
        self._session.arm()

    def _found(self) -> frozenset[str]:
        focus = {"focus"} if self._focus.available else set()
        trigger = {"software_trigger"} if self._options.software_trigger else set()
        return self._settings.capabilities | focus | trigger

    def _set_trigger(self) -> None:
        features = self._session.features
        if self._options.software_trigger and not features.has("TriggerSoftware"):
            raise DeviceRefused(
                f"{self._device}: the camera has no TriggerSoftware; "
                "say software_trigger: false for one that streams by itself"
            )
        for other in _OTHER_TRIGGERS:
            self._switch_off_trigger(other)
        on = {"TriggerSource": "Software", "TriggerMode": "On"}
        wanted = on if self._options.software_trigger else {"TriggerMode": "Off"}
        first = {"AcquisitionMode": "Continuous", "TriggerSelector": "FrameStart"}
        for name, value in {**first, **wanted}.items():
            if features.has(name) and features.read(name) != value:
                features.write(name, value)

    def _switch_off_trigger(self, name: str) -> None:
        features = self._session.features
        if not features.has("TriggerSelector"):
            return
        try:
            features.write("TriggerSelector", name)
            features.write("TriggerMode", "Off")
        except DeviceRefused:
            return  # the camera has no such trigger

    def _take(self, deadline_s: float, missed: list[str]) -> _Taken:
        self._session.flush()
        sent_s = time.monotonic()
        self._trigger(deadline_s)
        acknowledged_s = time.monotonic()
        raw = self._fetch(deadline_s)
        image = decode(raw.data, raw.width, raw.height, raw.pixel_format)
        return _Taken(raw, image, sent_s, acknowledged_s, time.monotonic(), missed)

    def _trigger(self, deadline_s: float) -> None:
        self._unanswered_trigger = True
        if self._options.software_trigger:
            self._session.features.execute("TriggerSoftware")
            return
        for _ in range(self._options.stale_frames):
            self._fetch(deadline_s)

    def _fetch(self, deadline_s: float) -> RawFrame:
        begun_s = time.monotonic()
        if self._options.software_trigger:
            patience_s = self.values.get("exposure_s", 0.0) + self._options.patience_s
            deadline_s = min(deadline_s, begun_s + patience_s)
        while (left_s := deadline_s - time.monotonic()) > 0:
            raw = self._session.fetch(min(left_s, _SLICE_S))
            if raw is not None:
                self._unanswered_trigger = False
                return raw
            if self.lost:
                raise DeviceUnreachable(f"{self._device}: the connection was lost; connect again")
        raise FrameMissing(f"no frame came within {time.monotonic() - begun_s:.2f} s")

    def _lost_frame(self, missed: list[str], last: Exception) -> FrameMissing:
        tries = "; ".join([*missed, str(last)])
        return FrameMissing(
            f"{self._device}: {tries}. If this happens with every trigger, no packet of this size "
            "may pass the network (MTU), or a firewall drops the stream"
        )

    def _frame(self, taken: _Taken) -> Frame:
        raw, ns = taken.raw, taken.raw.device_timestamp_ns
        return Frame(
            image=taken.image,
            host_t_s=self._middle_s(taken),
            device_t_s=None if ns is None else ns * 1e-9,
            exposure_s=self.values.get("exposure_s"),
            gain_db=self.values.get("gain_db"),
            focus_position=self._focus.position(),
            temperature_c=self._settings.temperature_c(),
            raw={
                **raw.raw,
                "trigger_sent_s": taken.sent_s,
                "trigger_acknowledged_s": taken.acknowledged_s,
                "arrived_s": taken.arrived_s,
                "device_timestamp_ns": ns,
                "pixel_format": raw.pixel_format,
                "missed": taken.missed,
            },
        )

    def _middle_s(self, taken: _Taken) -> float:
        exposure_s = self.values.get("exposure_s", 0.0)
        if self._options.software_trigger:
            return (taken.sent_s + taken.acknowledged_s + exposure_s) / 2
        return taken.arrived_s - exposure_s / 2  # late by the transfer, which nobody states
