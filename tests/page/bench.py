"""A page with a run behind it: fed by hand, or by a simulated cell in real time."""

from __future__ import annotations

import json
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

from calib.detection import Detection
from cell.devices.simulated_cell import home_of, simulated_cell
from cell.sequencer.checks import Verdict
from cell.sequencer.journal import Journal
from cell.sequencer.sequencer import Devices, Sequencer
from cell.sequencer.session import header_of
from cell.sequencer.shot import Shot
from cell.sequencer.states import RunResult, State, Status
from cell.sequencer.watcher import Checked
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.recording import FrameRecord, PoseRecord, RecordingWriter
from cell.views.page.address import Address
from cell.views.page.application import OWN_HEADER
from cell.views.page.live_run import LiveRun
from cell.views.page.server import LivePage
from drivers.camera import Frame
from sim.build import build
from sim.clock import WallClock
from tests.cell.fakes import HOME, FakeArm

CONFIGS = Path(__file__).parents[2] / "configs"
LOOPBACK = Address.parse("127.0.0.1:0")


def plan_of(folder: Path, views: int = 12, more: str = "") -> Plan:
    """Views of the shipped plan for the small camera, made quick."""
    (folder / "ur3-robotiq.cell.yaml").write_text((CONFIGS / "ur3-robotiq.cell.yaml").read_text())
    text = (CONFIGS / "ur3-robotiq.plan.yaml").read_text().replace("m_s: 0.1", "m_s: 0.25")
    head, *listed = re.split(r"(?m)^(?=- )", text)
    path = folder / "plan.yaml"
    path.write_text(head.replace("views:", f"{more}\nviews:") + "".join(listed[:views]))
    return read_plan(path)


@contextmanager
def served(live: LiveRun, address: Address = LOOPBACK) -> Iterator[str]:
    with LivePage(live, address) as url:
        yield url


def ask(
    url: str, path: str = "/", *, method: str = "GET", query: str = "", **headers: str
) -> tuple[int, str]:
    """Status and body; `headers` are sent with - for _."""
    response = connect(url, path, method=method, query=query, **headers)
    return response.status, response.read().decode()


def connect(
    url: str,
    path: str,
    *,
    method: str = "GET",
    query: str = "",
    source: str = "127.0.0.1",
    **headers: str,
) -> HTTPResponse:
    parts = urlsplit(url)
    connection = HTTPConnection(
        parts.hostname or "", parts.port, timeout=20, source_address=(source, 0)
    )
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    joined = "&".join(filter(None, [parts.query, query]))
    connection.request(method, f"{path}?{joined}", headers=named)
    return connection.getresponse()


def press(url: str, button: str, query: str = "") -> tuple[int, str]:
    """Press a button as the page itself does."""
    status, body = ask(
        url, f"/{button}", method="POST", query=query, **{OWN_HEADER.replace("-", "_"): "1"}
    )
    return status, json.loads(body)["words"] if body.startswith("{") else body


def events(url: str, wanted: set[str]) -> dict[str, dict[str, object]]:
    """The first of each wanted event."""
    response, found, name = connect(url, "/events"), {}, ""
    while wanted - set(found):
        line = response.readline().decode().strip()
        if line.startswith("event: "):
            name = line.removeprefix("event: ")
        elif line.startswith("data: "):
            found.setdefault(name, json.loads(line.removeprefix("data: ")))
    response.close()
    return found


def status(state: State, index: int = 3, event: str | None = None) -> Status:
    return Status(state, f"view {index}", 3, 1, 12, 95.0, event, index)


def checked(plan: Plan, index: int = 3, fault: str | None = None) -> Checked:
    """A frame of noise with a grid of corners on it."""
    camera, board = plan.cell.camera, plan.cell.board.board()
    image = np.random.default_rng(index).integers(0, 255, (camera.height, camera.width), np.uint8)
    row, column = np.divmod(np.arange(board.corner_count), board.cols)
    corners = np.stack([300 + 60 * column, 150 + 60 * row], axis=1).astype(float)
    ones = np.ones(len(corners))
    found = Detection(
        corners, np.tile(np.eye(2) * 0.01, (len(corners), 1, 1)), 0.1 * ones, ones, 200 * ones,
        True, 0.01,
    )  # fmt: skip
    arm = FakeArm()
    shot = Shot(index, Frame(image, 0.0, exposure_s=0.01), (arm.state(),), tuple(HOME))
    record = FrameRecord(frame=index, base_from_flange=PoseRecord.of(arm.state().base_from_flange))
    return Checked(shot, Verdict(fault, found), None if fault else record)


class RealTimeRun:
    """A simulated cell whose moves take as long as real ones, run in a thread."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        self.live = LiveRun(plan, simulated=True, folder=str(folder))
        clock = WallClock()
        self.arm, camera = build(simulated_cell(plan.cell, home_of(plan)), clock)
        self.result: RunResult | None = None
        self._writer = RecordingWriter.create(folder, header_of(plan, simulated=True))
        self._sequencer = Sequencer(
            plan,
            Devices(self.arm, camera, clock),
            self._writer,
            Journal(folder),
            stop=self.live.stop,
            requests=self.live.requests,
            watchers=[self.live],
        )
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        with self._writer:
            self.result = self._sequencer.run()
        self.live.recorded(self.result)

    def __enter__(self) -> RealTimeRun:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.live.stop.ask("the end of the test")
        self._thread.join(60)

    def ended(self) -> RunResult:
        self._thread.join(60)
        assert self.result is not None
        return self.result


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
