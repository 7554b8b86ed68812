"""The page's server from outside: who is let in, what is reported, and that no run waits for it."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from cell.cli.app import app
from cell.cli.page_option import with_addresses
from cell.errors import EXIT_OPERATOR, InputError
from cell.sequencer.session import header_of
from cell.sequencer.states import Finish, RunResult, State
from cell.storage.files.camera_file import GenicamCamera
from cell.storage.files.provenance import made_by
from cell.storage.recording import read_recording
from cell.views.page.address import DEFAULT, Address, is_address
from cell.views.page.application import MOST_STREAMS
from cell.views.page.live_run import LiveRun
from cell.views.page.parts import run_part
from cell.views.page.picture import jpeg
from cell.views.running_estimate.estimate import Estimate
from tests.page.bench import ask, checked, connect, events, plan_of, press, served, status


@pytest.fixture
def live(tmp_path: Path) -> LiveRun:
    return LiveRun(plan_of(tmp_path), simulated=True, folder="runs/monday")


@pytest.fixture
def url(live: LiveRun) -> Iterator[str]:
    with served(live) as url:
        yield url


# -- who is let in


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.7", "localhost", "[::1]"])
def test_the_loopback_address_needs_no_token(host: str) -> None:
    assert Address.parse(f"{host}:8470").token == ""


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.4", "[::]", "cell-pc"])
def test_any_other_address_has_a_token_of_its_own(host: str) -> None:
    first, second = (Address.parse(f"{host}:8470") for _ in range(2))
    assert len(first.token) >= 20
    assert first.token != second.token
    assert first.token in first.url(8470)


@pytest.mark.parametrize("text", ["8470", "127.0.0.1", "127.0.0.1:99999", "a b:1", "::1:80"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is no HOST:PORT"):
        Address.parse(text)


def test_a_plan_is_not_taken_for_an_address() -> None:
    assert is_address("0.0.0.0:80")
    assert not is_address("configs/ur3-robotiq.plan.yaml")


@pytest.mark.parametrize(
    ("words", "filled"),
    [
        (["p.yaml", "--page"], ["p.yaml", f"--page={DEFAULT}"]),
        (["--page", "p.yaml", "--json"], [f"--page={DEFAULT}", "p.yaml", "--json"]),
        (["--page", "0.0.0.0:80", "p.yaml"], ["--page=0.0.0.0:80", "p.yaml"]),
        (["--page=[::1]:80", "p.yaml"], ["--page=[::1]:80", "p.yaml"]),
        (["--page", "--page", "a:1"], [f"--page={DEFAULT}", "--page=a:1"]),
    ],
)
def test_the_address_may_be_left_out(words: list[str], filled: list[str]) -> None:
    assert list(with_addresses(words)) == filled


def test_a_bad_address_touches_no_recording(tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    words = ["run", str(plan.path), "--dry-run", "-o", str(tmp_path / "run")]
    result = CliRunner().invoke(app, [*words, "--page=somewhere"])
    assert isinstance(result.exception, InputError)
    assert not (tmp_path / "run").exists()


def test_a_taken_port_is_reported(url: str) -> None:
    with pytest.raises(InputError, match="cannot listen there"):
        Address("127.0.0.1", urlsplit(url).port or 0, "").listen()


@pytest.mark.parametrize("path", ["/", "/events", "/frame.jpg", "/stop", "/pause", "/skip"])
@pytest.mark.parametrize("query", ["", "token=", "token=wrong"])
def test_without_the_token_nothing_is_answered(live: LiveRun, path: str, query: str) -> None:
    with served(live, Address("127.0.0.1", 0, "a-secret")) as url:
        bare = url.split("?")[0]
        method = "GET" if path in ("/", "/events", "/frame.jpg") else "POST"
        assert ask(bare, path, method=method, query=query, x_cell_page="1")[0] == 403
    assert not live.stop.asked
    assert not live.requests.paused


def test_with_the_token_the_page_and_its_buttons_work(live: LiveRun) -> None:
    with served(live, Address("127.0.0.1", 0, "a-secret")) as url:
        assert url.endswith("?token=a-secret")
        assert ask(url)[0] == 200
        assert press(url, "stop")[0] == 200
    assert live.stop.asked


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"origin": "http://elsewhere.example"},
        {"origin": "http://elsewhere.example", "x_cell_page": "1"},
        {"origin": "null", "x_cell_page": "1"},
        {"origin": "http://[", "x_cell_page": "1"},
        {"host": "elsewhere.example", "x_cell_page": "1"},
        {"host": "elsewhere.example:8470", "x_cell_page": "1"},
    ],
)
def test_another_web_page_cannot_press_the_buttons(
    live: LiveRun, url: str, headers: dict[str, str]
) -> None:
    for button in ("stop", "pause", "go-on", "skip"):
        assert ask(url, f"/{button}", method="POST", query="view=3", **headers)[0] == 403
    assert not live.stop.asked


def test_a_name_of_elsewhere_sees_nothing(url: str) -> None:
    assert ask(url, host="elsewhere.example")[0] == 403


def test_the_own_page_is_same_origin(live: LiveRun, url: str) -> None:
    origin = url.rstrip("/")
    assert ask(url, "/stop", method="POST", origin=origin, x_cell_page="1")[0] == 200
    assert live.stop.asked


def test_a_get_stops_nothing(live: LiveRun, url: str) -> None:
    assert ask(url, "/stop", x_cell_page="1")[0] == 405
    assert not live.stop.asked


def test_the_page_needs_nothing_from_elsewhere_and_may_not_be_framed(url: str) -> None:
    response = connect(url, "/")
    body = response.read().decode()
    assert response.headers["x-frame-options"] == "DENY"
    assert "default-src 'none'" in response.headers["content-security-policy"]
    outside = set(re.findall(r"https?://[^\"'\s]+", body)) - {"http://www.w3.org/2000/svg"}
    assert outside == set()
    assert "emergency stop" not in re.sub(r"not an emergency stop", "", body.lower())


# -- what is reported


def test_a_new_browser_hears_everything_at_once(live: LiveRun, url: str, tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    live.status_changed(status(State.MOVING, event="frame 2 logged"))
    live.checked(checked(plan))
    sigma_px = np.array([0.3, 0.2])
    distance_m = np.array([0.34, 0.6])
    live.estimated(
        Estimate(9, 9, "", distance_m, 1370 + 0 * sigma_px, sigma_px, ("views at 0.5 m",), None)
    )
    wanted = {"run", "now", "frame", "camera", "coverage", "estimate", "messages"}
    shown = events(url, wanted)
    assert shown["run"]["simulated"] is True
    begun = f"Begun {datetime.now().astimezone():%Y-%m-%d}"
    assert str(shown["run"]["provenance"]).startswith(begun)
    assert f"by {made_by()['program']}; camera " in str(shown["run"]["provenance"])
    assert shown["now"]["state"] == "moving"
    assert shown["now"]["left_s"] == 95.0
    assert len(shown["frame"]["corners"]) == 70  # type: ignore[arg-type]
    assert shown["frame"]["max_blur_px"] == 6.0
    assert shown["camera"]["values"] == [{"name": "exposure", "value": "0.01 s"}]
    assert shown["estimate"]["history"] == [[9, 0.3]]
    assert shown["messages"]["lines"][0]["words"] == "frame 2 logged"  # type: ignore[index]


def test_the_page_names_the_devices_as_the_report_does(tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    assert plan.cell.robot.model
    options = {"driver": "genicam", "producer": Path("grab.cti"), "serial": "E0417"}
    known = plan.cell.camera.model_dump(include={"model", "width", "height", "focus"})
    camera = GenicamCamera.model_validate(known | options)
    named = replace(plan, cell=plan.cell.model_copy(update={"camera": camera}))
    text = run_part(named, simulated=False, folder="runs/monday")["provenance"]
    assert f"camera {camera.model or 'of unknown model'} (serial E0417)" in text
    assert f"robot {plan.cell.robot.model} (serial not known)" in text
    assert header_of(named, simulated=False).as_mapping()["camera"]["serial"] == "E0417"


def test_coverage_counts_planned_and_seen(live: LiveRun, tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    before = dict(live.parts["coverage"].content)
    live.checked(checked(plan, index=4))
    live.checked(checked(plan, index=5, fault="blurred"))
    now = live.parts["coverage"].content
    assert sum(before["seen_cells"]) == 0
    assert len(before["planned"]) == 12
    assert [round(view[0], 2) for view in before["planned"][:2]] == [0.52, 0.5]
    assert now["seen_views"] == [4]
    assert max(now["seen_cells"]) == 1
    assert live.parts["frame"].content["kept"] is False
    assert live.parts["frame"].content["fault"] == "blurred"


def test_only_the_newest_picture_is_given(live: LiveRun, url: str, tmp_path: Path) -> None:
    plan = plan_of(tmp_path)
    assert ask(url, "/frame.jpg", query="number=1")[0] == 404
    live.checked(checked(plan, 3))
    live.checked(checked(plan, 4))
    assert ask(url, "/frame.jpg", query="number=1")[0] == 404
    response = connect(url, "/frame.jpg", query="number=2")
    shown = cv2.imdecode(np.frombuffer(response.read(), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert shown is not None
    assert shown.shape == (724, 1279)


def test_a_picture_of_twelve_bits_shows_what_is_saturated() -> None:
    image = np.full((30, 2560), 4095, np.uint16)
    image[:, :1280] = 2048
    shown = cv2.imdecode(np.frombuffer(jpeg(image), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert shown is not None
    assert shown.shape == (15, 1280)
    assert abs(int(shown[5, 100]) - 128) < 4
    assert shown[5, 1000] > 250


def test_a_run_that_hangs_is_reported_as_hanging(
    live: LiveRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    live.status_changed(status(State.MOVING))
    live.read(checked(live._plan).shot.states[0])
    assert live.now()["silent_s"] == 0
    later = time.monotonic() + 7.0
    monkeypatch.setattr("cell.views.page.live_run.time.monotonic", lambda: later)
    assert live.now()["silent_s"] == pytest.approx(7.0, abs=0.5)
    live.status_changed(status(State.FINISHED))
    assert live.now()["silent_s"] == 0


# -- what is asked


def test_pause_go_on_and_skip_reach_the_run(live: LiveRun, url: str) -> None:
    live.status_changed(status(State.MOVING, 3))
    assert press(url, "pause")[0] == 200
    assert live.requests.paused
    assert press(url, "go-on")[0] == 200
    assert not live.requests.paused
    assert press(url, "skip", "view=3") == (200, "view 3 is given up.")
    assert live.requests.skips(3)
    assert live.now()["asked"] == {"stop": False, "pause": False, "skip": True}


def test_a_click_that_comes_late_skips_no_other_view(live: LiveRun, url: str) -> None:
    live.status_changed(status(State.MOVING, 4))
    for view in ("3", "", "x"):
        assert press(url, "skip", f"view={view}")[0] == 409
    assert not live.requests.skips(4)


def test_after_the_run_the_buttons_say_so(live: LiveRun, url: str) -> None:
    live.status_changed(status(State.FINISHED))
    assert press(url, "stop") == (409, "The run is over; the arm was let go of.")


def test_how_it_ended_is_reported_with_the_files_there_are(live: LiveRun, url: str) -> None:
    live.recorded(RunResult(Finish.COMPLETED, "", 12, {}, ended_early="alpha is known"))
    live.ended("completed: 12 frames", {"report": "runs/monday/report.html"})
    end = events(url, {"end"})["end"]
    assert (end["words"], end["reason"]) == ("completed", "alpha is known")
    assert end["files"] == {"report": "runs/monday/report.html"}
    assert end["final"] is True


# -- nobody waits for it


def test_a_browser_that_does_not_listen_holds_nothing_up(
    live: LiveRun, url: str, tmp_path: Path
) -> None:
    plan = plan_of(tmp_path)
    parts = urlsplit(url)
    deaf = socket.create_connection((parts.hostname, parts.port))
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    deaf.sendall(f"GET /events HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n".encode())
    frame = checked(plan)
    for _ in range(300):
        live.checked(frame)
        live.say("x" * 200)
    assert press(url, "stop")[0] == 200
    assert events(url, {"frame"})["frame"]["number"] == 300
    deaf.close()


def test_too_many_followers_leave_the_stop_alone(live: LiveRun, url: str) -> None:
    desks = [f"127.0.0.{2 + number // 20}" for number in range(MOST_STREAMS)]
    followers = [connect(url, "/events", source=desk) for desk in desks]
    for follower in followers:
        assert follower.readline()
    assert ask(url, "/events")[0] == 503
    assert press(url, "stop")[0] == 200
    for follower in followers:
        follower.close()


def test_a_page_that_cannot_show_ends_its_stream_and_nothing_else(
    live: LiveRun, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken() -> dict[str, object]:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(live, "now", broken)
    response = connect(url, "/events")
    assert b"retry" in response.readline()
    monkeypatch.undo()
    assert press(url, "stop")[0] == 200
    assert "now" in events(url, {"now"})


def test_a_dry_run_is_stopped_through_its_page(tmp_path: Path) -> None:
    """The whole of it: the command, its printed address, the button, exit status 4."""
    plan = plan_of(tmp_path, 39)
    words = [sys.executable, "-c", "from cell.cli import main; main()", "run"]
    words += [str(plan.path), "--page", "127.0.0.1:0"]
    words += ["--dry-run", "-o", str(tmp_path / "run"), "--json"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        assert run.stderr is not None
        url = ""
        while not url:
            line = run.stderr.readline()
            assert line, "the run ended without an address"
            url = line.removeprefix("live page: ").strip() if "live page:" in line else ""
        shown = events(url, {"frame"})
        assert shown["frame"]["corners"]
        assert press(url, "stop")[0] == 200
        out, err = run.communicate(timeout=120)
    assert run.returncode == EXIT_OPERATOR, err
    result = json.loads(out)
    assert result["finish"] == "stopped_by_operator"
    assert result["reason"] == "stopped by the page's Stop button"
    assert len(read_recording(tmp_path / "run").frames) == result["frames"] < 39
