"""Strangers at the page: they cannot hold a run up, and Stop comes through."""

from __future__ import annotations

import os
import resource
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from cell.errors import DiskFailed
from cell.sequencer.session import header_of
from cell.sequencer.states import Finish
from cell.storage.recording import FrameRecord, RecordingWriter, read_recording
from cell.views.page import connections
from cell.views.page.application import OWN_HEADER
from cell.views.page.connections import MOST_OF_ADDRESS, MOST_OPEN
from cell.views.page.live_run import LiveRun
from tests.page.bench import RealTimeRun, ask, plan_of, press, served

HALF = b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "


@pytest.fixture
def live(tmp_path: Path) -> LiveRun:
    return LiveRun(plan_of(tmp_path), simulated=True, folder="runs/monday")


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def stranger(url: str, source: str = "127.0.0.1") -> socket.socket:
    parts = urlsplit(url)
    return socket.create_connection(
        (parts.hostname or "", parts.port or 0), timeout=5, source_address=(source, 0)
    )


@contextmanager
def half_sent(url: str, count: int, source: str = "127.0.0.1") -> Iterator[list[socket.socket]]:
    """Connections that sent half a request each, in a process of its own descriptors' worth."""
    opened: list[socket.socket] = []
    try:
        for _ in range(count):
            with suppress(OSError):  # reset at the door
                opened.append(stranger(url, source))
                opened[-1].sendall(HALF)
        yield opened
    finally:
        for connection in opened:
            connection.close()


def test_half_sent_requests_take_few_descriptors(live: LiveRun) -> None:
    with served(live) as url:
        ask(url)
        before = descriptors()
        with half_sent(url, 300) as opened:
            time.sleep(0.3)
            taken = descriptors() - before - len(opened)
        assert taken <= MOST_OF_ADDRESS
        with (
            half_sent(url, 100, "127.0.0.2") as one,
            half_sent(url, 100, "127.0.0.3") as two,
            half_sent(url, 100, "127.0.0.4") as three,
        ):
            time.sleep(0.3)
            taken = descriptors() - before - len(one) - len(two) - len(three)
        assert taken <= MOST_OPEN


def test_a_request_has_a_time_to_be_whole(live: LiveRun, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "REQUEST_S", 0.5)
    body = b"POST /pause HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100000\r\n\r\n"
    with served(live) as url:
        for start in (b"", HALF, body):
            with closing(stranger(url)) as connection:
                connection.sendall(start)
                began_s, answer = time.monotonic(), b"-"
                while answer and time.monotonic() - began_s < 20.0:
                    try:
                        connection.sendall(b"x" if start else b"")
                        connection.settimeout(0.1)
                        answer = connection.recv(4096)
                    except TimeoutError:
                        continue
                    except OSError:
                        answer = b""
                assert not answer, start
                assert time.monotonic() - began_s > 0.3, start


def test_who_was_answered_stays_in_under_a_flood(live: LiveRun) -> None:
    with served(live) as url:
        parts = urlsplit(url)
        tablet = HTTPConnection(parts.hostname or "", parts.port, timeout=5)
        tablet.request("GET", "/")
        tablet.getresponse().read()
        with half_sent(url, 400):
            began_s = time.monotonic()
            tablet.request("POST", "/stop", headers={OWN_HEADER: "1"})
            assert tablet.getresponse().status == 200
            assert time.monotonic() - began_s < connections.REQUEST_S - 0.2
        assert live.stop.asked
        tablet.close()


def test_another_address_comes_in_during_a_flood(live: LiveRun) -> None:
    with served(live) as url, half_sent(url, 400, "127.0.0.2"):
        began_s = time.monotonic()
        assert press(url, "stop")[0] == 200
        # at once, if on a busy machine; whoever has to wait, waits for `REQUEST_S`
        assert time.monotonic() - began_s < connections.REQUEST_S - 0.2
    assert live.stop.asked


def test_strangers_that_were_answered_and_stay_leave_room(live: LiveRun) -> None:
    page = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    opened = []
    with served(live) as url:
        for number in range(MOST_OPEN):
            opened.append(stranger(url, f"127.0.0.{2 + number // MOST_OF_ADDRESS}"))
            opened[-1].sendall(page)
            assert opened[-1].recv(64)
        assert press(url, "stop")[0] == 200
        for connection in opened:
            connection.close()
    assert live.stop.asked


def test_a_run_goes_on_while_strangers_flood_its_page(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, views=2)
    with RealTimeRun(plan, tmp_path / "run") as run, served(run.live) as url:
        over = threading.Event()

        def flood() -> None:
            while not over.is_set():
                with half_sent(url, 50, "127.0.0.9"):
                    over.wait(0.5)

        flooding = threading.Thread(target=flood, daemon=True)
        flooding.start()
        result = run.ended()
        over.set()
        flooding.join(10)
    assert result.finish is Finish.COMPLETED, result.reason
    assert len(read_recording(tmp_path / "run").frames) == 2


def test_a_lack_of_descriptors_is_called_by_its_name(tmp_path: Path) -> None:
    header = header_of(plan_of(tmp_path), simulated=True)
    with RecordingWriter.create(tmp_path / "r", header) as writer:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, hard))
        try:
            with pytest.raises(DiskFailed, match="no file descriptor is left"):
                writer.append(FrameRecord(frame=0), np.zeros((4, 4), np.uint8))
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
