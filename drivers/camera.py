"""The protocol of a camera: armed once, triggered by software for each pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class FocusSetting:
    """How to focus: `auto` (once per pose, then log), `hold`, or `position` (`steps`)."""

    mode: str = "hold"
    position: float | None = None


@dataclass(frozen=True)
class Frame:
    """One whole image and what is known of it.

    Attributes
    ----------
    image:
        (height, width) uint8 or uint16, or (height, width, 3) uint8 in BGR order.
    host_t_s:
        Host clock (`time.monotonic` based) of the middle of the exposure as well as it is known.
    device_t_s:
        The camera's own clock, seconds, or None.
    exposure_s, gain_db, focus_position, focus_distance_m, temperature_c:
        As read back from the camera; None where it does not say.
    raw:
        Further values to log.
    """

    image: NDArray[np.generic]
    host_t_s: float
    device_t_s: float | None = None
    exposure_s: float | None = None
    gain_db: float | None = None
    focus_position: float | None = None
    focus_distance_m: float | None = None
    temperature_c: float | None = None
    raw: dict[str, Any] = field(default_factory=dict)


class Camera(Protocol):
    """A camera that gives one frame for each trigger."""

    tried_on_hardware: bool

    def connect(self) -> None:
        """Open, switch every automatism off, arm; raises `DeviceError`."""

    def configure(
        self, *, exposure_s: float | None = None, gain_db: float | None = None
    ) -> Mapping[str, float]:
        """Set and read back; returns what the camera then has. Raises `DeviceRefused` if unlike."""

    def focus(self, setting: FocusSetting) -> float | None:
        """Focus, wait until ready, return the position read back (None: unknown)."""

    def grab(self, timeout_s: float) -> Frame:
        """Trigger and return this trigger's frame, never an older one; raises `FrameMissing`."""

    def close(self) -> None:
        """Stop the stream and let go of the camera. Idempotent."""
