"""A Robotiq vision server whose pictures come from any `drivers.camera.Camera`.

It behaves as users of the URCap describe it: JPEG pictures of the newest video frame, and, on some
firmware only, settings as one JSON document.
"""

from __future__ import annotations

import http.server
import ipaddress
import json
import socket
import threading
import time
from dataclasses import dataclass
from types import TracebackType
from typing import Any
from urllib.parse import parse_qs, urlsplit

import cv2
import numpy as np
from numpy.typing import NDArray

from drivers.camera import Camera, FocusSetting
from drivers.errors import DeviceError
from sim.peers.http import DroppableServer
from sim.peers.robotiq.settings import Settings


@dataclass
class RobotiqFaults:
    """What goes wrong, to order; may be changed while the server runs.

    Attributes
    ----------
    frozen:
        The server repeats its last picture.
    cut_short:
        So many of the next pictures end in the middle.
    answer_delay_s:
        Added before each answer.
    ignore_focus_lock:
        `focusAuto` stays on, whatever is set.
    mute:
        Requests are taken and never answered.
    """

    frozen: bool = False
    cut_short: int = 0
    answer_delay_s: float = 0.0
    ignore_focus_lock: bool = False
    mute: bool = False


class RobotiqPeer:
    """The server; `start` begins, `close` ends it.

    Parameters
    ----------
    source:
        Where pictures come from. Exposure, gain and focus are passed on to it.
    has_settings:
        Whether this firmware answers `getcamerasettings` and `setcamerasettings`.
    autofocus_period_s:
        How often a lens that focuses by itself looks again.
    frame_rate_hz:
        Rate of the video; between two frames the same JPEG file is given again.
    """

    def __init__(
        self,
        source: Camera,
        *,
        address: str = "127.0.0.1",
        port: int = 0,
        has_settings: bool = True,
        frame_rate_hz: float = 30.0,
        autofocus_period_s: float = 1.0,
    ) -> None:
        if not ipaddress.IPv4Address(address).is_loopback:
            raise ValueError(f"{address} is no loopback address: this server stays on loopback")
        self.faults = RobotiqFaults()
        self.settings: Settings
        self.has_settings = has_settings
        self.display_size: tuple[int, int] | None = None
        self._source, self._period_s = source, 1 / frame_rate_hz
        self._autofocus_period_s, self._focused_s = autofocus_period_s, -1e9
        self._where = address, port
        self._lock = threading.Lock()
        self._picture, self._taken_s = b"", -1e9

    def start(self) -> RobotiqPeer:
        """Listen and answer, in threads of its own."""
        self._source.connect()
        position = self._source.focus(FocusSetting("hold"))
        self.settings = Settings(self._source.configure(), position)
        self._server = _Server(self._where, _Handler)
        self._server.peer = self
        self._where = self._server.server_address[0:2]  # type: ignore[assignment]
        threading.Thread(
            target=self._server.serve_forever, args=(0.02,), daemon=True, name="robotiq"
        ).start()
        return self

    def close(self) -> None:
        """Stop listening and cut the connections."""
        self._server.end()

    def __enter__(self) -> RobotiqPeer:
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        self.close()

    @property
    def address(self) -> str:
        """`host:port` where it listens."""
        return f"{self._where[0]}:{self._where[1]}"

    def picture(self) -> bytes:
        """The newest video frame as a JPEG file."""
        with self._lock:
            if not self.faults.frozen and time.monotonic() - self._taken_s >= self._period_s:
                self._taken_s = time.monotonic()
                self._picture = self._take()
            if self.faults.cut_short > 0:
                self.faults.cut_short -= 1
                return self._picture[: len(self._picture) // 2]
            return self._picture

    def change(self, wanted: dict[str, Any]) -> None:
        """Take over settings and pass exposure, gain and focus on to the source."""
        if self.faults.ignore_focus_lock:
            wanted = {**wanted, "focusAuto": True}
        with self._lock:
            new = self.settings.changed(wanted)
            self._source.configure(exposure_s=new.exposure_s, gain_db=new.gain_db)
            old, self.settings = self.settings, new
            begins = new.focuses_itself and not old.focuses_itself
            if begins or new.values.get("focus") != old.values.get("focus"):
                self._focus()

    def _focus(self) -> None:
        position = self._source.focus(self.settings.focus_order)
        self._focused_s = time.monotonic()
        if position is not None:
            self.settings.set_focus(position)

    def _take(self) -> bytes:
        looked_s = time.monotonic() - self._focused_s
        if self.settings.focuses_itself and looked_s > self._autofocus_period_s:
            self._focus()
        taken = self._source.grab(timeout_s=60.0).image
        shift = 8 if taken.dtype == np.uint16 else 0
        image: NDArray[np.uint8] = (taken.astype(np.uint16) >> shift).astype(np.uint8)
        if self.display_size:
            image = np.asarray(
                cv2.resize(image, self.display_size, interpolation=cv2.INTER_AREA), np.uint8
            )
        _, encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])
        return encoded.tobytes()


class _Server(DroppableServer):
    peer: RobotiqPeer


class _Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: _Server

    def setup(self) -> None:
        super().setup()
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def do_GET(self) -> None:
        url = urlsplit(self.path)
        peer = self.server.peer
        match url.path:
            case "/current.jpg":
                self._answer(peer.picture(), "image/jpeg")
            case "/getcamerasettings" if peer.has_settings:
                document = {"cameraSettings": peer.settings.values}
                self._answer(json.dumps(document).encode(), "application/json")
            case "/setdisplaysize":
                query = parse_qs(url.query)
                peer.display_size = int(query["width"][0]), int(query["height"][0])
                self._answer(b"", "text/plain")
            case _:
                self.send_error(404)

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        if urlsplit(self.path).path != "/setcamerasettings" or not self.server.peer.has_settings:
            self.send_error(404)
            return
        try:
            self.server.peer.change(json.loads(body)["cameraSettings"])
        except DeviceError as error:
            self.send_error(400, str(error))
        else:
            self._answer(b"", "text/plain")

    def _answer(self, body: bytes, kind: str) -> None:
        faults = self.server.peer.faults
        time.sleep(faults.answer_delay_s)
        while faults.mute:
            time.sleep(0.02)
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Keep the terminal quiet."""
