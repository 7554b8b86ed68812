"""Aravis 0.8 through PyGObject: open by address, stream, features, errors by name.

Aravis and PyGObject are Debian packages and are imported when a camera is opened. What Aravis does
unasked, and is set right here: it does not check ranges, opens a camera it may not control, chooses
packets longer than the network carries, asks for a socket buffer far too small for a frame, and
drops what follows a restart on the same stream as late.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Iterator
from typing import Any

from drivers.aravis_network import packet_bytes_for, receive_buffer_hint
from drivers.errors import DeviceRefused, DeviceUnreachable
from drivers.genicam_session import IncompleteFrame, RawFrame

_log = logging.getLogger(__name__)
_BUFFERS = 4
_SOCKET_BUFFER_BYTES = 32_000_000
_FRAME_RETENTION_US = 500_000
_OTHER_PROGRAM = (
    "another program controls the camera: close its viewer or the other run "
    "(a program that crashed lets go after about 3 s)"
)
# ArvDeviceError: not connected, transfer error, time-out, not found
_UNREACHABLE_CODES = {2, 4, 5, 6}
_ACCESS_DENIED_CODE = 17


def import_aravis() -> tuple[Any, Any]:
    """The modules Aravis and GLib; raises `DeviceRefused` with the way to install them."""
    try:
        import gi

        gi.require_version("Aravis", "0.8")
        from gi.repository import Aravis, GLib
    except (ImportError, ValueError) as error:
        raise DeviceRefused(
            f"Aravis is missing ({error}): apt-get install python3-gi gir1.2-aravis-0.8, "
            "in a virtual environment made with --system-site-packages"
        ) from None
    return Aravis, GLib


@contextlib.contextmanager
def _named(device: str, glib: Any) -> Iterator[None]:
    try:
        yield
    except glib.Error as error:
        of_device = error.domain == "arv-device-error-quark"
        if of_device and error.code in _UNREACHABLE_CODES:
            message = f"{device}: {error.message}; check its power, cable and address"
            raise DeviceUnreachable(message) from None
        if of_device and error.code == _ACCESS_DENIED_CODE:
            raise DeviceUnreachable(
                f"{device}: it no longer takes our orders: it was switched off and on, or another "
                "program took control; connect again"
            ) from None
        raise DeviceRefused(f"{device}: {error.message}") from None


class AravisFeatures:
    """`drivers.genicam_session.Features` of an Aravis device."""

    def __init__(self, device: Any, name: str, aravis: Any, glib: Any) -> None:
        self._device, self._name, self._aravis, self._glib = device, name, aravis, glib

    def has(self, name: str) -> bool:
        """Whether the feature exists and is available now."""
        with self._errors():
            return bool(
                self._device.is_feature_implemented(name)
                and self._device.is_feature_available(name)
            )

    def read(self, name: str) -> float | str:
        """A number, or the name of an enumeration's entry."""
        with self._errors():
            kind = self._kind(name)
            return getattr(self._device, f"get_{kind}_feature_value")(name)  # type: ignore[no-any-return]

    def write(self, name: str, value: float | str) -> None:
        """Set a number, or an enumeration by its entry's name; out of range is refused."""
        with self._errors():
            kind = self._kind(name)
            cast = {"integer": int, "float": float, "boolean": bool, "string": str}[kind]
            getattr(self._device, f"set_{kind}_feature_value")(name, cast(value))

    def execute(self, name: str) -> None:
        """Do a command."""
        with self._errors():
            self._device.execute_command(name)

    def release(self) -> None:
        """Let go of the device: its destructor must run in the thread that closes the session."""
        self._device = None

    def _errors(self) -> contextlib.AbstractContextManager[None]:
        return _named(self._name, self._glib)

    def _kind(self, name: str) -> str:
        node = self._device.get_feature(name)
        kinds = {
            "GcEnumeration": "string",
            "GcBoolean": "boolean",
            "GcString": "string",
            "GcFloat": "float",
            "GcInteger": "integer",
        }
        for interface, kind in kinds.items():
            if isinstance(node, getattr(self._aravis, interface)):
                return kind
        raise DeviceRefused(f"{self._name}: the camera has no value named {name}")


class AravisSession:
    """An open GigE Vision (or USB3 Vision) camera; use it from one thread.

    Parameters
    ----------
    address:
        IP address, or an Aravis camera id.
    packet_bytes:
        Stream packet size; None: what the network to the address carries.
    control_wait_s:
        How long to wait for a camera that another program still holds.
    """

    def __init__(self, address: str, packet_bytes: int | None, control_wait_s: float) -> None:
        self._aravis, self._glib = import_aravis()
        self._name, self._packet_bytes = f"camera {address}", packet_bytes
        self._camera = self._open(address, control_wait_s)
        device = self._camera.get_device()
        device.set_range_check_policy(self._aravis.RangeCheckPolicy.ENABLE)
        lost = threading.Event()
        device.connect("control-lost", lambda _: lost.set())
        self._lost, self._device = lost, device
        self._stream: Any = None
        self.features = AravisFeatures(device, self._name, self._aravis, self._glib)
        if self._camera.is_gv_device():
            self._set_packet_size(address)

    @property
    def lost(self) -> bool:
        """Whether Aravis' heartbeat found the camera gone or in other hands."""
        return self._lost.is_set()

    def arm(self) -> None:
        """Start an acquisition on a new stream; the old one would drop restarted frame ids."""
        self._disarm()
        with _named(self._name, self._glib):
            payload_bytes = self._camera.get_payload()
            stream = self._camera.create_stream(None, None)
            if self._camera.is_gv_device():
                self._set_stream_options(stream, payload_bytes)
            for _ in range(_BUFFERS):
                stream.push_buffer(self._aravis.Buffer.new_allocate(payload_bytes))
            self._stream = stream
            self._camera.start_acquisition()

    def flush(self) -> None:
        """Drop frames that have already come."""
        while (buffer := self._stream.try_pop_buffer()) is not None:
            self._stream.push_buffer(buffer)

    def fetch(self, timeout_s: float) -> RawFrame | None:
        """The next frame, or None when none came."""
        buffer = self._stream.timeout_pop_buffer(int(timeout_s * 1e6))
        if buffer is None:
            return None
        try:
            return self._whole(buffer)
        finally:
            self._stream.push_buffer(buffer)

    def close(self, *, polite: bool) -> None:
        """Stop and let go; a lost camera is not asked any more, each question would take 2.5 s."""
        if polite:
            try:
                self._disarm()
                with _named(self._name, self._glib):
                    if self._camera.is_gv_device():
                        self._device.leave_control()
            except (DeviceRefused, DeviceUnreachable) as error:
                _log.debug("closing: %s", error)
        self._stream = self._device = self._camera = None
        self.features.release()

    def _open(self, address: str, control_wait_s: float) -> Any:
        deadline_s = time.monotonic() + control_wait_s
        while True:
            with _named(self._name, self._glib):
                camera = self._aravis.Camera.new(address)
            device = camera.get_device()
            if not camera.is_gv_device() or device.is_controller():
                return camera
            if time.monotonic() > deadline_s:
                raise DeviceRefused(f"{self._name}: {_OTHER_PROGRAM}")
            del camera, device
            time.sleep(0.2)

    def _set_packet_size(self, address: str) -> None:
        wanted = self._packet_bytes or packet_bytes_for(address)
        with _named(self._name, self._glib):
            self._camera.gv_set_packet_size_adjustment(self._aravis.GvPacketSizeAdjustment.NEVER)
            self._camera.gv_set_packet_size(wanted)
            got = self._camera.gv_get_packet_size()
        if got != wanted:
            raise DeviceRefused(f"{self._name}: packet size set to {wanted}, the camera has {got}")

    def _set_stream_options(self, stream: Any, payload_bytes: int) -> None:
        hint = receive_buffer_hint(payload_bytes)
        if hint:
            _log.info("%s: %s", self._name, hint)
        stream.set_property("socket-buffer", self._aravis.GvStreamSocketBuffer.FIXED)
        stream.set_property("socket-buffer-size", _SOCKET_BUFFER_BYTES)
        stream.set_property("packet-resend", self._aravis.GvStreamPacketResend.ALWAYS)
        stream.set_property("frame-retention", _FRAME_RETENTION_US)

    def _disarm(self) -> None:
        if self._stream is not None:
            self._stream = None
            with _named(self._name, self._glib):
                self._camera.stop_acquisition()

    def _whole(self, buffer: Any) -> RawFrame:
        status = buffer.get_status()
        if status != self._aravis.BufferStatus.SUCCESS:
            raise IncompleteFrame(f"frame {buffer.get_frame_id()} came with {status.value_nick}")
        return RawFrame(
            data=buffer.get_data(),
            width=buffer.get_image_width(),
            height=buffer.get_image_height(),
            pixel_format=str(self.features.read("PixelFormat")),
            device_timestamp_ns=buffer.get_timestamp(),
            raw={
                "frame_id": buffer.get_frame_id(),
                "host_timestamp_ns": buffer.get_system_timestamp(),
            },
        )
