"""Takes pictures from the source and sends them, in the one thread that touches the source."""

from __future__ import annotations

import contextlib
import functools
import logging
import queue
import random
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from drivers.camera import Camera
from drivers.errors import DeviceError
from sim.peers.gige.gvsp import Block, pixels_as

_log = logging.getLogger(__name__)
_BURST_BYTES = 64_000
_KEPT_FOR_RESEND = 4
_LAST_BLOCK_ID = 0xFFFF


@dataclass
class Faults:
    """What goes wrong, to order; may be changed while the device runs.

    Attributes
    ----------
    packet_loss:
        Chance that a stream packet, resent ones too, is lost.
    resend:
        Whether the device answers requests for lost packets.
    largest_packet_bytes:
        Longer stream packets vanish, as behind a switch without jumbo frames.
    frame_latency_s:
        Added between the end of the exposure and the first packet.
    answer_delay_s:
        Added before each answer on the control channel.
    mute:
        Nothing is answered on the control channel.
    skip_frames:
        So many of the next triggers are swallowed.
    """

    packet_loss: float = 0.0
    resend: bool = True
    largest_packet_bytes: int = 65535
    frame_latency_s: float = 0.0
    answer_delay_s: float = 0.0
    mute: bool = False
    skip_frames: int = 0


@dataclass(frozen=True)
class Acquisition:
    """How to take and where to send pictures.

    `period_s` None: only when triggered; `number` counts the acquisitions since power-on.
    """

    host: tuple[str, int]
    packet_bytes: int
    packet_delay_s: float
    pixel_format: int
    width: int
    height: int
    exposure_s: float
    period_s: float | None
    single_frame: bool
    number: int = 0


class Streamer:
    """The device's exposure and stream engine.

    Parameters
    ----------
    link_bytes_s:
        Packets leave no faster than a link of that rate carries them.
    """

    def __init__(
        self, source: Camera, address: str, faults: Faults, link_bytes_s: float, seed: int
    ) -> None:
        self._source, self._faults, self._link = source, faults, link_bytes_s
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, 0))
        self._random = random.Random(seed)
        self._jobs: queue.Queue[Callable[[], None] | None] = queue.Queue()
        self._acquisition: Acquisition | None = None
        self._sent: deque[Block] = deque(maxlen=_KEPT_FOR_RESEND)
        self._block_id = self._started = 0
        self._powered_on_ns = time.monotonic_ns()
        self.resent_packets = 0
        self.frames_sent = 0
        self._thread = threading.Thread(target=self._work, daemon=True, name=f"gige {address}")
        self._thread.start()

    @property
    def port(self) -> int:
        """The UDP port that pictures are sent from."""
        return int(self._socket.getsockname()[1])

    def clock_ns(self) -> int:
        """The device's own clock: nanoseconds since power-on."""
        return time.monotonic_ns() - self._powered_on_ns

    def order(self, job: Callable[[], None]) -> None:
        """Have the thread that owns the source do `job`, after what was ordered before."""
        self._jobs.put(job)

    def start(self, acquisition: Acquisition) -> None:
        """Begin an acquisition; block ids restart at one, as the standard asks."""
        self._block_id = 0
        self._sent.clear()
        self._started += 1
        self._acquisition = replace(acquisition, number=self._started)

    def set_exposure(self, exposure_s: float) -> None:
        """Let a running acquisition follow a change of the exposure."""
        if self._acquisition:
            self._acquisition = replace(self._acquisition, exposure_s=exposure_s)

    def halt(self) -> None:
        """End the acquisition; pictures still being exposed or sent are dropped."""
        self._acquisition = None

    @property
    def acquiring(self) -> bool:
        """Whether an acquisition runs."""
        return self._acquisition is not None

    def trigger(self) -> None:
        """Take one picture of the running acquisition."""
        acquisition = self._acquisition
        if acquisition:
            self.order(lambda: self._take(acquisition))

    def resend(self, block_id: int, first: int, last: int) -> None:
        """Send packets of a recent block again; called from the control thread."""
        acquisition = self._acquisition
        block = next((b for b in tuple(self._sent) if b.block_id == block_id), None)
        if acquisition is None or block is None or not self._faults.resend:
            return
        for packet_id in range(first, min(last, block.packets - 1) + 1):
            self.resent_packets += 1
            self._send_packet(block, packet_id, acquisition)

    def send_raw(self, data: bytes, host: tuple[str, int]) -> None:
        """Send a datagram from the stream's port, if it is not too long for the network."""
        if len(data) + 28 <= self._faults.largest_packet_bytes:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, host)

    def close(self) -> None:
        """Stop the thread, dropping what it has not sent."""
        self.halt()
        self._jobs.put(None)
        self._thread.join()
        self._socket.close()

    def _work(self) -> None:
        while (job := self._next_job()) is not None:
            try:
                job()
            except DeviceError as error:
                _log.warning("the picture source of the GigE Vision device failed: %s", error)

    def _next_job(self) -> Callable[[], None] | None:
        while True:
            acquisition = self._acquisition
            period_s = acquisition.period_s if acquisition else None
            try:
                return self._jobs.get(timeout=0.02 if period_s is None else period_s)
            except queue.Empty:
                if acquisition and period_s is not None:
                    return functools.partial(self._take, acquisition)

    def _take(self, acquisition: Acquisition) -> None:
        opened_ns, opened_s = self.clock_ns(), time.monotonic()
        image = self._source.grab(timeout_s=60.0).image
        if self._faults.skip_frames > 0:
            self._faults.skip_frames -= 1
            return
        pixels = pixels_as(
            image[: acquisition.height, : acquisition.width], acquisition.pixel_format
        )
        self._block_id = self._block_id % _LAST_BLOCK_ID + 1
        block = Block(
            self._block_id,
            pixels,
            acquisition.width,
            acquisition.height,
            acquisition.pixel_format,
            opened_ns,
            acquisition.packet_bytes,
        )
        closed_s = opened_s + acquisition.exposure_s + self._faults.frame_latency_s
        time.sleep(max(0.0, closed_s - time.monotonic()))
        self._send(block, acquisition)

    def _runs(self, acquisition: Acquisition) -> bool:
        return self._acquisition is not None and self._acquisition.number == acquisition.number

    def _send(self, block: Block, acquisition: Acquisition) -> None:
        self._sent.append(block)
        begun_s, sent_bytes = time.monotonic(), 0
        for packet_id in range(block.packets):
            if not self._runs(acquisition):
                return
            self._send_packet(block, packet_id, acquisition)
            sent_bytes += block.packet_bytes
            if acquisition.packet_delay_s > 0 or sent_bytes % _BURST_BYTES < block.packet_bytes:
                due_s = begun_s + sent_bytes / self._link + packet_id * acquisition.packet_delay_s
                time.sleep(max(0.0, due_s - time.monotonic()))
        self.frames_sent += 1
        if acquisition.single_frame:
            self.halt()

    def _send_packet(self, block: Block, packet_id: int, acquisition: Acquisition) -> None:
        if self._random.random() >= self._faults.packet_loss:
            self.send_raw(block.packet(packet_id), acquisition.host)
