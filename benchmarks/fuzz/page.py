"""Requests to the live page of a run, byte by byte, over its socket."""

from __future__ import annotations

import atexit
import random
import socket
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from urllib.parse import urlsplit

from benchmarks.fuzz.kind import REFUSED, Kind
from cell.storage.files.plan_file import read_plan
from cell.views.page.address import Address
from cell.views.page.live_run import LiveRun
from cell.views.page.server import LivePage

_PLAN = Path(__file__).parents[2] / "configs" / "ur3-robotiq.plan.yaml"
_WAIT_S = 2.0
_HEAD = b"Host: 127.0.0.1\r\nOrigin: http://127.0.0.1\r\nX-Cell-Page: 1\r\n"
_CHUNKED = b"Transfer-Encoding: chunked\r\n"
_STRANGERS = random.Random(0)


class PageFailed(Exception):
    """The page failed over a request, or did not answer it."""


def page() -> Iterator[Kind]:
    """All of them."""
    requests = (
        b"GET /?token=a HTTP/1.1\r\n" + _HEAD + b"\r\n",
        b"GET /frame.jpg?number=3 HTTP/1.1\r\n" + _HEAD + b"\r\n",
        b"POST /skip?view=3 HTTP/1.1\r\n" + _HEAD + b"Content-Length: 2\r\n\r\n{}",
        b"POST /pause HTTP/1.1\r\n"
        + _HEAD
        + b"Transfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n",
    )
    yield Kind("page request", requests, lambda _, data: _asked(data), REFUSED)


@cache
def _served() -> int:
    """Port of a page that is served until this process ends."""
    stack = ExitStack()
    atexit.register(stack.close)
    folder = stack.enter_context(tempfile.TemporaryDirectory())
    live = LiveRun(read_plan(_PLAN), simulated=True, folder=folder)
    url = stack.enter_context(LivePage(live, Address.parse("127.0.0.1:0")))
    return urlsplit(url).port or 0


def _asked(data: bytes) -> bytes:
    # from an address of its own: one that asks too often is kept waiting, and rightly so
    stranger = f"127.{_STRANGERS.randrange(1, 255)}.{_STRANGERS.randrange(255)}.9"
    with socket.create_connection(
        ("127.0.0.1", _served()), _WAIT_S, source_address=(stranger, 0)
    ) as link:
        try:
            link.sendall(data)
            link.shutdown(socket.SHUT_WR)
            answer = link.recv(65536)
        except TimeoutError:
            raise PageFailed(f"no answer within {_WAIT_S:g} s") from None
        except OSError:  # it closed the connection before all was sent, or at once
            return b""
    if answer.split(b"\r\n", 1)[0].split()[1:2] == [b"500"]:
        raise PageFailed("status 500")
    return answer
