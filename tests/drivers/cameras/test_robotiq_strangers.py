"""A Robotiq vision server, or whatever stands in its place, sends what it should not."""

from __future__ import annotations

import json
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import DeviceError, DeviceRefused, DeviceUnreachable, FrameMissing
from drivers.jpeg import jpeg_size
from drivers.robotiq import RobotiqCamera
from drivers.robotiq_http import MOST_PIXELS, RobotiqHttp
from sim.peers.listener import Listener

SECRET = b"\x1b[31mraw-bytes-of-a-stranger"
PICTURE = cv2.imencode(".jpg", np.zeros((48, 64), np.uint8))[1].tobytes()
SETTINGS = {"exposure": 1000, "gain": 16, "focus": 400, "focusAuto": False}


def reply(body: bytes, status: bytes = b"200 OK", kind: bytes = b"text/plain") -> bytes:
    length = str(len(body)).encode()
    head = b"HTTP/1.1 " + status + b"\r\nContent-Type: " + kind
    return head + b"\r\nContent-Length: " + length + b"\r\n\r\n" + body


@contextmanager
def answering(answer: Callable[[str], bytes]) -> Iterator[RobotiqHttp]:
    """A server whose whole answer, head and all, depends on the path that is asked for."""
    port = 0

    def serve(link) -> None:  # type: ignore[no-untyped-def]
        with suppress(OSError):
            for line in link.makefile("r", errors="replace"):
                if line.startswith(("GET", "POST")):
                    link.sendall(answer(line.split()[1]))

    server = Listener(("127.0.0.1", 0), serve)
    port = server._server.getsockname()[1]
    http = RobotiqHttp("127.0.0.1", port)
    try:
        yield http
    finally:
        http.close()
        server.close()


def soon() -> float:
    return time.monotonic() + 2.0


@pytest.mark.parametrize(
    "answer",
    [SECRET + b"\r\n\r\n", b"HTTP/1.1 200 " + b"x" * 70_000, reply(SECRET, b"500 " + SECRET)],
    ids=["no HTTP", "an endless status line", "an error of its own"],
)
def test_what_a_server_sends_reaches_no_message(answer: bytes) -> None:
    with answering(lambda _: answer) as http:
        for ask in (http.picture, lambda end: http.change({}, end)):
            with pytest.raises(DeviceError) as raised:
                ask(soon())
            output = str(raised.value)
            assert "raw-bytes" not in output
            assert output.isprintable()
            assert len(output) < 300


def jpeg_that_says(width: int, height: int) -> bytes:
    """The picture, with another size in its frame header."""
    for marker in (b"\xff\xc0", b"\xff\xc2"):
        at = PICTURE.find(marker)
        if at >= 0:
            return PICTURE[: at + 5] + struct.pack(">HH", height, width) + PICTURE[at + 9 :]
    raise AssertionError("no frame header")


def test_a_picture_over_the_stated_size_is_refused_before_it_is_decoded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def never(*_: object) -> None:
        raise AssertionError("decoded")

    monkeypatch.setattr(cv2, "imdecode", never)
    with answering(lambda _: reply(jpeg_that_says(65000, 65000))) as http:
        camera = RobotiqCamera(f"127.0.0.1:{http._http._connection.port}")
        with pytest.raises(DeviceRefused, match="65000 x 65000"):
            camera.connect()
        camera.close()


def test_a_body_without_an_end_is_given_up() -> None:
    def flood(_: str) -> bytes:
        return b"HTTP/1.1 200 OK\r\n\r\n" + bytes(1 << 26)

    with answering(flood) as http, pytest.raises(DeviceUnreachable):
        http.picture(time.monotonic() + 20.0)


@pytest.mark.parametrize(
    "body",
    [b"[" * 200_000, b'{"cameraSettings":' * 50_000, b"\xff\xfe", b"null", b'{"cameraSettings":1}'],
    ids=["deep", "deeper", "no text", "null", "no settings"],
)
def test_settings_that_cannot_be_read_are_none_at_all(body: bytes) -> None:
    with answering(lambda _: reply(body)) as http:
        assert http.settings(soon()) is None


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("focus", "much"),
        ("focus", None),
        ("exposure", [1]),
        ("gain", -3),
        ("exposure", 1e300),
        ("exposure", float("nan")),
        ("focusAuto", "no"),
        ("exposureAuto", 1),
    ],
)
def test_a_setting_that_cannot_be_is_refused_by_name(name: str, value: object) -> None:
    def answer(path: str) -> bytes:
        if "settings" in path:
            return reply(json.dumps({"cameraSettings": {**SETTINGS, name: value}}).encode())
        return reply(PICTURE)

    with answering(answer) as http:
        camera = RobotiqCamera(f"127.0.0.1:{http._http._connection.port}")
        with pytest.raises(DeviceError, match=f"setting {name} is n"):
            camera.connect()
        camera.close()


@pytest.mark.parametrize("form", [".jpg"])
@pytest.mark.parametrize(("height", "width"), [(48, 64), (1, 1), (777, 33)])
def test_the_size_of_a_picture_is_the_one_that_is_decoded(
    form: str, height: int, width: int
) -> None:
    for options in ([], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 2]):
        written = cv2.imencode(form, np.zeros((height, width, 3), np.uint8), options)[1].tobytes()
        assert jpeg_size(written) == (width, height)


def test_a_thumbnail_in_the_header_is_not_the_picture() -> None:
    small = cv2.imencode(".jpg", np.zeros((8, 8), np.uint8))[1].tobytes()
    segment = b"\xff\xe1" + struct.pack(">H", len(small) + 2) + small
    assert jpeg_size(PICTURE[:2] + segment + PICTURE[2:]) == (64, 48)


@given(st.binary(max_size=200))
def test_no_bytes_make_the_size_raise(data: bytes) -> None:
    size = jpeg_size(b"\xff\xd8\xff" + data)
    assert size is None or min(size) >= 0


def test_a_picture_of_no_size_is_no_picture() -> None:
    assert MOST_PIXELS >= 4096 * 4096
    with answering(lambda _: reply(b"\xff\xd8\xff\xd9")) as http, pytest.raises(FrameMissing):
        http.picture(soon())
