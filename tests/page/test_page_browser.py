"""The page in a real browser: what it shows, what its buttons do, what it says when it is old."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import WebDriverWait

from cell.sequencer.states import Finish, State
from cell.storage.recording import read_recording
from cell.views.page import live_run
from cell.views.page.address import Address
from cell.views.page.live_run import LiveRun
from tests.page.bench import RealTimeRun, checked, free_port, plan_of, served, status

PATIENCE_S = 90.0


class Tab:
    """What a person does with the page."""

    def __init__(self, chrome: webdriver.Chrome) -> None:
        self.chrome = chrome

    def open(self, url: str) -> None:
        self.chrome.get(url)

    def get(self, name: str) -> WebElement:
        return self.chrome.find_element(By.ID, name)

    def text(self, name: str) -> str:
        return self.get(name).text

    def until(self, true: Callable[[], object]) -> None:
        WebDriverWait(self.chrome, PATIENCE_S, 0.1).until(lambda _: true())

    def reached(self, name: str) -> bool:
        """Whether a finger on the middle of a button hits the button."""
        hit = self.chrome.execute_script(
            "const r = document.getElementById(arguments[0]).getBoundingClientRect();"
            "const e = document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2);"
            "return e && e.closest('button')?.id",
            name,
        )
        return bool(hit == name)

    def marks(self, drawing: str, kind: str) -> int:
        return len(self.get(drawing).find_elements(By.TAG_NAME, kind))


@pytest.fixture
def tab(chromium: webdriver.Chrome) -> Tab:
    chromium.set_window_size(1200, 1000)
    return Tab(chromium)


def test_a_run_is_seen_paused_skipped_and_stopped(tab: Tab, tmp_path: Path) -> None:
    plan = plan_of(tmp_path, 12)
    with RealTimeRun(plan, tmp_path / "run") as run, served(run.live) as url:
        tab.open(url)
        assert tab.get("simulated").is_displayed()
        tab.until(lambda: tab.marks("picture", "path") == 4)
        shot = tab.get("shot")
        assert (shot.get_property("naturalWidth"), shot.is_displayed()) == (1279, True)
        assert tab.text("frame-verdict") == "Kept, 70 corners"
        assert "good" in tab.text("blur")
        assert tab.marks("distances", "circle") == 12
        tab.until(lambda: "of 12 taken" in tab.text("views"))

        tab.get("pause").click()
        tab.until(lambda: tab.text("state").startswith("paused: "))
        assert str(tab.get("aloud").get_property("textContent")).startswith("paused: ")
        place = run.arm.truth().joints_rad
        view = run.live.status.index if run.live.status else None
        tab.get("skip").send_keys(Keys.ENTER)
        tab.until(lambda: "given up" in tab.text("state"))
        assert (run.arm.truth().joints_rad == place).all()
        assert tab.text("pause").endswith("Go on")
        tab.get("pause").send_keys(Keys.SPACE)
        tab.until(lambda: "1 given up" in tab.text("views"))
        tab.until(lambda: tab.text("state").startswith("moving"))

        tab.get("stop").click()
        result = run.ended()
        assert result.finish is Finish.STOPPED_BY_OPERATOR
        assert result.reason == "stopped by the page's Stop button"
        assert result.skipped == {view: "given up by the operator"}
        tab.until(lambda: tab.text("end-words") == "stopped by the operator")
        assert not tab.get("stop").is_enabled()
        assert len(read_recording(tmp_path / "run").frames) == result.frames


@pytest.fixture
def live(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> LiveRun:
    """A run that stands still, which nobody reads an arm for."""
    monkeypatch.setattr(live_run, "SILENT_S", 1e6)
    live = LiveRun(plan_of(tmp_path), simulated=False, folder="runs/monday")
    live.status_changed(status(State.PAUSED, event="paused"))
    live.checked(checked(plan_of(tmp_path)))
    return live


def test_what_is_old_says_so_and_comes_back_by_itself(tab: Tab, live: LiveRun) -> None:
    port = free_port()
    with served(live, Address("127.0.0.1", port, "")) as url:
        tab.open(url)
        tab.until(lambda: tab.text("state").startswith("paused: view 3"))
        assert not tab.get("stale").is_displayed()
        assert not tab.get("simulated").is_displayed()
    tab.until(lambda: "NOT LIVE" in tab.text("stale"))
    assert "old" in tab.chrome.find_element(By.TAG_NAME, "body").get_attribute("class")
    assert tab.chrome.title.startswith("OLD")
    tab.chrome.execute_script("scrollTo(0, 100000)")
    assert tab.reached("stop")
    tab.get("stop").click()
    tab.until(lambda: "DID NOT GET THROUGH" in tab.text("answer"))
    with served(live, Address("127.0.0.1", port, "")):
        tab.until(lambda: not tab.get("stale").is_displayed())
        tab.get("stop").click()
        tab.until(lambda: live.stop.asked)


def test_a_run_that_hangs_does_not_look_live(
    tab: Tab, live: LiveRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_run, "SILENT_S", 0.0)
    with served(live) as url:
        tab.open(url)
        tab.until(lambda: "has not read the arm" in tab.text("stale"))


def test_after_the_end_the_page_stays_and_links_to_nothing(tab: Tab, live: LiveRun) -> None:
    live.status_changed(status(State.FINISHED))
    live.ended("completed: 12 frames", {"report": "runs/monday/report.html"})
    with served(live) as url:
        tab.open(url)
        tab.until(lambda: tab.text("end-result") == "completed: 12 frames")
    tab.until(lambda: "The program has ended" in tab.text("stale"))
    assert "report: runs/monday/report.html" in tab.text("end-files")
    assert not tab.chrome.find_elements(By.TAG_NAME, "a")
    assert not any(tab.get(name).is_enabled() for name in ("stop", "pause", "skip"))


@pytest.mark.parametrize("width", [1200, 768, 420])
def test_it_fits_a_tablet_and_a_telephone(tab: Tab, live: LiveRun, width: int) -> None:
    with served(live, Address("127.0.0.1", 0, "a-token")) as url:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 1000}
        tab.chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        try:
            tab.open(url)
            tab.until(lambda: tab.marks("picture", "path") == 4)
            wide = tab.chrome.execute_script("return document.documentElement.scrollWidth")
            assert wide <= width
            for name in ("stop", "pause", "skip"):
                button = tab.get(name).rect
                assert min(button["width"], button["height"]) >= 44
                assert 0 <= button["x"] <= button["x"] + button["width"] <= width
                assert tab.reached(name)
        finally:
            tab.chrome.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
