"""From the page's Stop button to the arm: an HTTP request beside Ctrl-C, in the same runs.

``python benchmarks/stop_latency.py [TIMES]`` runs a simulated cell in real time (its pictures are
rendered, its corners searched, a browser follows the page) and stops it at a random instant: in
turn by a POST over a new connection, and by SIGINT. The time runs until `Arm.stop` is called.
"""

from __future__ import annotations

import os
import re
import signal
import sys
import tempfile
import threading
import time
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from cell.devices.simulated_cell import home_of, simulated_cell
from cell.sequencer.sequencer import Devices
from cell.sequencer.session import record_plan
from cell.storage.files.plan_file import Plan, read_plan
from cell.views.page.address import Address
from cell.views.page.application import OWN_HEADER
from cell.views.page.live_run import LiveRun
from cell.views.page.server import LivePage
from sim.arm import SimArm
from sim.build import build
from sim.clock import WallClock

CONFIGS = Path(__file__).parents[1] / "configs"
LONGEST_WAIT_S = 6.0


def plan_of(folder: Path) -> Plan:
    text = (CONFIGS / "ur3-robotiq.plan.yaml").read_text()
    head, *views = re.split(r"(?m)^(?=- )", text)
    (folder / "ur3-robotiq.cell.yaml").write_text((CONFIGS / "ur3-robotiq.cell.yaml").read_text())
    (folder / "plan.yaml").write_text(head + "".join(views[:12]))
    return read_plan(folder / "plan.yaml")


def follow(url: str) -> HTTPConnection:
    parts = urlsplit(url)
    connection = HTTPConnection(parts.hostname or "", parts.port)
    connection.request("GET", "/events")
    response = connection.getresponse()
    threading.Thread(target=lambda: [None for _ in response], daemon=True).start()
    return connection


def press(url: str) -> None:
    parts = urlsplit(url)
    connection = HTTPConnection(parts.hostname or "", parts.port)
    connection.request("POST", "/stop", headers={OWN_HEADER: "1"})
    connection.getresponse().read()


def once(plan: Plan, folder: Path, wait_s: float, *, by_page: bool) -> float:
    """Seconds from asking to `Arm.stop`."""
    clock = WallClock()
    arm, camera = build(simulated_cell(plan.cell, home_of(plan)), clock)
    live = LiveRun(plan, simulated=True, folder=str(folder))
    asked: list[float] = []
    stopped = watched_stops(arm)
    with LivePage(live, Address.parse("127.0.0.1:0")) as url:
        follow(url)

        def ask() -> None:
            asked.append(time.monotonic())
            press(url) if by_page else os.kill(os.getpid(), signal.SIGINT)

        threading.Timer(wait_s, ask).start()
        record_plan(
            plan,
            folder,
            Devices(arm, camera, clock),
            simulated=True,
            stop=live.stop,
            requests=live.requests,
            watchers=[live],
        )
    return stopped[0] - asked[0]


def watched_stops(arm: SimArm) -> list[float]:
    """When `stop` was called, as it happens."""
    called: list[float] = []
    stop = arm.stop

    def watched() -> None:
        called.append(time.monotonic())
        stop()

    arm.stop = watched  # type: ignore[method-assign]
    return called


def main(times: int) -> None:
    rng = np.random.default_rng(0)
    took: dict[str, list[float]] = {"POST /stop": [], "SIGINT": []}
    with tempfile.TemporaryDirectory() as scratch:
        plan = plan_of(Path(scratch))
        for k in range(times):
            for way, found in took.items():
                folder = Path(scratch) / f"{k}-{way[:4]}"
                wait_s = float(rng.uniform(0.5, LONGEST_WAIT_S))
                found.append(once(plan, folder, wait_s, by_page=way.startswith("POST")))
    print("| asked by | times | median ms | 90 % | worst |\n|---|---|---|---|---|")
    for way, found in took.items():
        ms = 1e3 * np.array(found)
        middle, most = np.percentile(ms, [50, 90])
        print(f"| {way} | {len(ms)} | {middle:.1f} | {most:.1f} | {ms.max():.1f} |")
    ratio = np.median(took["POST /stop"]) / np.median(took["SIGINT"])
    print(f"median of the page over that of the signal: {ratio:.1f}; load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
