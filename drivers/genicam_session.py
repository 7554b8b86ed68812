"""What a GenICam camera needs of its transport: features, and frames one at a time.

Aravis (GigE Vision, USB3 Vision) and GenTL producers (CoaXPress and others) each fill these in.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol


class Features(Protocol):
    """Access to features by their GenICam names.

    Every call raises `DeviceUnreachable` when the camera does not answer and `DeviceRefused`, with
    the reason, when it says no: unknown name, out of range, not writable now.
    """

    def has(self, name: str) -> bool:
        """Whether the feature exists and is available now."""

    def read(self, name: str) -> float | str:
        """A number, or the name of an enumeration's entry."""

    def write(self, name: str, value: float | str) -> None:
        """Set a number, or an enumeration by its entry's name."""

    def execute(self, name: str) -> None:
        """Do a command."""


@dataclass(frozen=True)
class RawFrame:
    """A whole frame as it came: its own copy of the samples, and what the transport reports."""

    data: bytes
    width: int
    height: int
    pixel_format: str
    device_timestamp_ns: int | None
    raw: dict[str, Any] = field(default_factory=dict)


class IncompleteFrame(Exception):
    """A buffer came that is not whole; its pixels must not be used."""


class Session(Protocol):
    """An open camera, used from one thread."""

    @property
    def features(self) -> Features:
        """The camera's features."""

    @property
    def lost(self) -> bool:
        """Whether the transport noticed that the camera is no longer ours."""

    def arm(self) -> None:
        """Start an acquisition on fresh buffers, ending the former one if there is one."""

    def flush(self) -> None:
        """Drop frames that have already come."""

    def fetch(self, timeout_s: float) -> RawFrame | None:
        """The next frame, or None when none came; raises `IncompleteFrame`."""

    def close(self, *, polite: bool) -> None:
        """Let go of the camera, without asking it where not `polite`; never raises."""
