"""A run while strangers flood its live page: how much longer it takes, and how soon Stop arrives.

``python benchmarks/page_flood.py`` runs a plan on a simulated cell in real time, in pairs: alone,
and with 1100 half-sent requests that another process holds open and renews, all on loopback. Then
it presses Stop during the flood, over the connection that a tablet has and over a new one from an
address of its own. Printed: seconds of each pair and their ratio, the median of the ratios and
their spread, and the time from the press until the run's stop flag was set. It takes about two
minutes, and needs a computer that does nothing else, or a raised priority (`nice -n -10`): each
pair reports the load that it met.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

from cell.devices.simulated_cell import home_of, simulated_cell
from cell.sequencer.sequencer import Devices
from cell.sequencer.session import record_plan
from cell.storage.files.plan_file import Plan, read_plan
from cell.views.page.address import Address
from cell.views.page.application import OWN_HEADER
from cell.views.page.live_run import LiveRun
from cell.views.page.server import LivePage
from sim.build import build
from sim.clock import WallClock

CONFIGS = Path(__file__).parents[1] / "configs"
CONNECTIONS = 1100
RENEW_S = 1.0
STRANGER, TABLET = "127.0.0.9", "127.0.0.5"
HALF = b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "


def flood(host: str, port: int) -> None:
    """Hold half-sent requests open, and open those anew that were closed, until killed."""
    os.nice(19)  # strangers work on computers of their own
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, CONNECTIONS + 100)), hard))
    held: list[socket.socket] = []
    while True:
        held = [connection for connection in held if still_open(connection)]
        while len(held) < CONNECTIONS:
            connection = socket.socket()
            connection.bind((STRANGER, 0))
            with suppress(OSError):
                connection.connect((host, port))
                connection.sendall(HALF)
            held.append(connection)
        time.sleep(RENEW_S)


def still_open(connection: socket.socket) -> bool:
    try:
        connection.setblocking(False)
        return connection.recv(1) != b""
    except BlockingIOError:
        return True
    except OSError:
        connection.close()
        return False


@contextmanager
def flooded(url: str) -> Iterator[None]:
    parts = urlsplit(url)
    command = [sys.executable, __file__, "--flood", f"{parts.hostname}:{parts.port}"]
    with subprocess.Popen(command) as strangers:
        time.sleep(2.0)
        try:
            yield
        finally:
            strangers.kill()


@contextmanager
def page(plan: Plan, folder: Path) -> Iterator[tuple[LiveRun, str]]:
    live = LiveRun(plan, simulated=True, folder=str(folder))
    with LivePage(live, Address.parse("127.0.0.1:0")) as url:
        yield live, url


def run_s(plan: Plan, folder: Path, *, strangers: bool) -> float:
    """Seconds that a run takes."""
    with page(plan, folder) as (live, url):
        if strangers:
            with flooded(url):
                return timed(plan, folder, live)
        return timed(plan, folder, live)


def timed(plan: Plan, folder: Path, live: LiveRun) -> float:
    clock = WallClock()
    arm, camera = build(simulated_cell(plan.cell, home_of(plan)), clock)
    began_s = time.monotonic()
    result = record_plan(plan, folder, Devices(arm, camera, clock), simulated=True, watchers=[live])
    assert not result.reason, result.reason
    return time.monotonic() - began_s


def stop_s(plan: Plan, folder: Path, *, kept: bool) -> float:
    """Seconds from the press of Stop during a flood until the run knows."""
    with page(plan, folder) as (live, url):
        parts = urlsplit(url)
        tablet = HTTPConnection(
            parts.hostname or "", parts.port, timeout=10, source_address=(TABLET, 0)
        )
        if kept:
            tablet.request("GET", "/")
            tablet.getresponse().read()
        with flooded(url):
            began_s = time.monotonic()
            tablet.request("POST", "/stop", headers={OWN_HEADER: "1"})
            while not live.stop.asked and time.monotonic() - began_s < 10.0:
                time.sleep(0.0005)
            took_s = time.monotonic() - began_s
            assert tablet.getresponse().status == 200
            tablet.close()
            return took_s


def plan_of(folder: Path, views: int) -> Plan:
    (folder / "ur3-robotiq.cell.yaml").write_text((CONFIGS / "ur3-robotiq.cell.yaml").read_text())
    text = (CONFIGS / "ur3-robotiq.plan.yaml").read_text()
    head, *listed = re.split(r"(?m)^(?=- )", text)
    (folder / "plan.yaml").write_text(head + "".join(listed[:views]))
    return read_plan(folder / "plan.yaml")


def pairs_of(plan: Plan, folder: Path, count: int) -> list[tuple[float, float]]:
    """Seconds alone and under the flood, one right after the other, each first in every other."""
    found = []
    for number in range(count):
        took: dict[bool, float] = {}
        for strangers in (False, True) if number % 2 == 0 else (True, False):
            took[strangers] = run_s(plan, folder / f"run-{number}-{strangers}", strangers=strangers)
        found.append((took[False], took[True]))
        ratio = took[True] / took[False]
        print(
            f"pair {number + 1}: alone {took[False]:.2f} s, under {CONNECTIONS} half-sent requests"
            f" {took[True]:.2f} s, ratio {ratio:.3f}; load {os.getloadavg()[0]:.1f}",
            flush=True,
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flood", help=argparse.SUPPRESS)
    parser.add_argument("--views", type=int, default=8)
    parser.add_argument("--pairs", type=int, default=4)
    parser.add_argument("--presses", type=int, default=4, help="of Stop, over each connection")
    asked = parser.parse_args()
    if asked.flood:
        host, _, port = asked.flood.partition(":")
        flood(host, int(port))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # what is compiled or read at first is no pair's
        run_s(plan_of(folder, 2), folder / "warm-up", strangers=False)
        plan = plan_of(folder, asked.views)
        ratios = [under_s / alone_s for alone_s, under_s in pairs_of(plan, folder, asked.pairs)]
        middle = statistics.median(ratios)
        print(f"ratio, median of {len(ratios)} pairs: {middle:.3f} ", end="")
        print(f"(from {min(ratios):.3f} to {max(ratios):.3f})", flush=True)
        for kept, connection in ((True, "the connection it has"), (False, "a new connection")):
            took = [stop_s(plan, folder, kept=kept) for _ in range(asked.presses)]
            print(f"Stop from a tablet over {connection}: {[round(1e3 * t, 1) for t in took]} ms")


if __name__ == "__main__":
    main()
