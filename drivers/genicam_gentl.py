"""GenTL producers through harvesters: frame grabbers for CoaXPress, and vendors' own transports.

`harvesters` and `genicam` are an extra (`pip install calibration-cell[genicam]`); the producer, a
`.cti` file, comes with the grabber. Guarded here: a fetch without time-out blocks for ever, a
buffer's memory changes once it is queued again, an incomplete buffer is dropped without a word,
fields that a producer does not fill raise, one process may load a producer only once, and a
container of parts (GenDC) is shown as one image that begins with the container's header.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable
from drivers.genicam_session import IncompleteFrame, RawFrame

_log = logging.getLogger(__name__)
_SEARCH_PATH = "GENICAM_GENTL64_PATH"
_BUFFERS = 4
_UNREACHABLE = {"TimeoutException", "IoException", "InvalidHandleException", "ClosedException"}


def import_harvesters() -> tuple[Any, Any, Any]:
    """The modules harvesters.core, genicam.genapi and genicam.gentl, or `DeviceRefused`."""
    try:
        from genicam import genapi, gentl
        from harvesters import core
    except ImportError as error:
        raise DeviceRefused(
            f"harvesters is missing ({error}): pip install 'calibration-cell[genicam]'"
        ) from None
    return core, genapi, gentl


def find_producer() -> str:
    """The one producer on GENICAM_GENTL64_PATH; raises `DeviceRefused` when it is not one."""
    folders = [Path(p) for p in os.environ.get(_SEARCH_PATH, "").split(os.pathsep) if p]
    found = sorted({str(cti) for folder in folders for cti in folder.glob("*.cti")})
    if len(found) != 1:
        listed = ", ".join(found) or "none"
        raise DeviceRefused(
            f"one GenTL producer (.cti) is needed and {_SEARCH_PATH} has {listed}; "
            "name the grabber's .cti file as the camera's producer in the cell file"
        )
    return found[0]


@contextlib.contextmanager
def _named(device: str) -> Iterator[None]:
    _, genapi, gentl = import_harvesters()
    try:
        yield
    except (genapi.GenericException, gentl.GenericException) as error:
        kind = type(error).__name__
        reason = str(error).split(" : ")[0].splitlines()[0]
        if kind in _UNREACHABLE:
            raise DeviceUnreachable(
                f"{device}: {kind}: {reason}; check its power and cable, then connect again"
            ) from None
        if kind in ("ResourceInUseException", "AccessDeniedException"):
            raise DeviceRefused(
                f"{device}: another program controls the camera: close its viewer or the other run"
            ) from None
        raise DeviceRefused(f"{device}: {reason}") from None


class NodeMapFeatures:
    """`drivers.genicam_session.Features` of a GenApi node map."""

    def __init__(self, node_map: Any, device: str) -> None:
        self._map, self._device = node_map, device
        _, self._genapi, _ = import_harvesters()

    def has(self, name: str) -> bool:
        """Whether the feature exists and is available now."""
        modes = self._genapi.EAccessMode
        with _named(self._device):
            if not self._map.has_node(name):
                return False
            return self._map.get_node(name).get_access_mode() not in (modes.NI, modes.NA)

    def read(self, name: str) -> float | str:
        """A number, or the name of an enumeration's entry."""
        with _named(self._device):
            value: float | str = self._node(name).value
        return value

    def write(self, name: str, value: float | str) -> None:
        """Set a number, or an enumeration by its entry's name; out of range is refused."""
        with _named(self._device):
            node = self._node(name)
            node.value = int(value) if isinstance(node, self._genapi.IInteger) else value

    def execute(self, name: str) -> None:
        """Do a command."""
        with _named(self._device):
            self._node(name).execute()

    def _node(self, name: str) -> Any:
        if not self._map.has_node(name):
            raise DeviceRefused(f"{self._device}: the camera has no feature {name}")
        return getattr(self._map, name)


class GenTLSession:
    """A camera behind a GenTL producer; use it from one thread.

    Parameters
    ----------
    producer:
        Path of the `.cti` file.
    select:
        Which device, by `id_`, `vendor`, `model`, `serial_number`; must leave exactly one.
    """

    def __init__(self, device: str, producer: str, select: Mapping[str, str]) -> None:
        self._core, _, self._gentl = import_harvesters()
        self._name = device
        if not Path(producer).is_file():
            raise DeviceRefused(f"{device}: there is no GenTL producer {producer}")
        self._harvester = self._core.Harvester()
        try:
            self._acquirer = self._open(producer, select)
        except BaseException:
            self._harvester.reset()
            raise
        self._incomplete = 0
        self._acquirer.num_buffers = _BUFFERS
        self._acquirer.add_callback(
            self._core.ImageAcquirer.Events.INCOMPLETE_BUFFER, _Counter(self._core, self)
        )
        self.features = NodeMapFeatures(self._acquirer.remote_device.node_map, device)

    @property
    def lost(self) -> bool:
        """GenTL reports a loss only when the camera is asked."""
        return False

    def note_incomplete(self) -> None:
        """A buffer came that is not whole; harvesters has put it back already."""
        self._incomplete += 1

    def arm(self) -> None:
        """Start an acquisition on fresh buffers."""
        with _named(self._name):
            if self._acquirer.is_acquiring():
                self._acquirer.stop()
            self._acquirer.start()

    def flush(self) -> None:
        """Drop frames that have already come."""
        with contextlib.suppress(IncompleteFrame):
            for _ in range(_BUFFERS):
                if self.fetch(1e-3) is None:
                    return

    def fetch(self, timeout_s: float) -> RawFrame | None:
        """The next frame, or None when none came."""
        before = self._incomplete
        with _named(self._name):
            buffer = self._acquirer.try_fetch(timeout=timeout_s)
        if self._incomplete != before:
            raise IncompleteFrame("a buffer came incomplete")
        if buffer is None:
            return None
        try:
            return self._copy(buffer)
        finally:
            with _named(self._name):
                buffer.queue()

    def close(self, *, polite: bool) -> None:
        """Stop and unload the producer, which a process can load only once."""
        try:
            with _named(self._name):
                self._acquirer.destroy()
                self._harvester.reset()
        except DeviceError as error:
            _log.log(logging.WARNING if polite else logging.DEBUG, "closing: %s", error)

    def _open(self, producer: str, select: Mapping[str, str]) -> Any:
        with _named(self._name):
            self._harvester.add_file(producer)
            self._harvester.update()
            listed = [_described(d) for d in self._harvester.device_info_list]
            try:
                return self._harvester.create(dict(select))
            except ValueError:
                raise DeviceRefused(_no_such(self._name, producer, select, listed)) from None
            except OSError as error:
                raise DeviceRefused(f"{self._name}: {producer} is no producer: {error}") from None

    def _copy(self, buffer: Any) -> RawFrame:
        self._require_image(buffer)
        components = buffer.payload.components
        if not components or components[0].width == 0:
            raise IncompleteFrame("a buffer came without an image")
        image = components[0]
        return RawFrame(
            data=image.data.tobytes(),
            width=image.width,
            height=image.height,
            pixel_format=image.data_format,
            device_timestamp_ns=self._optional(buffer, "timestamp_ns"),
            raw={"frame_id": self._optional(buffer.module, "frame_id")},
        )

    def _require_image(self, buffer: Any) -> None:
        """Refuse a container: harvesters shows a GenDC one as an image, header and all."""
        kind = self._optional(buffer.module, "payload_type")
        if kind != int(self._gentl.PAYLOADTYPE_INFO_IDS.PAYLOAD_TYPE_IMAGE):
            raise DeviceRefused(
                f"{self._name}: sends payloads of GenTL type {kind}, not plain images. Switch "
                "GenDC, chunk and multi-part streaming off: `features: {GenDCStreamingMode: "
                "'Off'}`, `{ChunkModeActive: false}` or the like in the cell file"
            )

    def _optional(self, owner: Any, field: str) -> int | None:
        try:
            return int(getattr(owner, field))
        except self._gentl.GenericException:
            return None


def _no_such(device: str, producer: str, select: Mapping[str, str], listed: list[str]) -> str:
    if not listed:
        return (
            f"{device}: {producer} shows no camera; check that it is a 64-bit GenTL producer, that "
            "the camera has power, and that no other program holds the grabber"
        )
    return f"{device}: {dict(select)} does not name one of: " + "; ".join(listed)


def _described(info: Any) -> str:
    return f"model {info.model}, serial_number {info.serial_number}, id_ {info.id_}"


def _Counter(core: Any, session: GenTLSession) -> Any:  # noqa: N802
    class Counter(core.Callback):  # type: ignore[misc]
        def emit(self, context: Any | None = None) -> None:
            session.note_incomplete()

    return Counter()
