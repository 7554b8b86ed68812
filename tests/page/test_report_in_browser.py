"""The report in a browser: nothing is cut on paper or a tablet, and the first screen is short."""

from __future__ import annotations

from pathlib import Path

import pytest
from selenium import webdriver

from cell.views.report import write_report
from tests.report.made_up_cell import full

CUT = """
const wide = document.documentElement.clientWidth + 1;
return [...document.querySelectorAll('table, svg, pre, nav, .card, .scroll')]
  .filter(e => e.checkVisibility())
  .filter(e => e.getBoundingClientRect().right > wide || e.scrollWidth > e.clientWidth + 1)
  .map(e => `${e.tagName} of ${e.closest('section')?.id}: ${(e.innerText || '').slice(0, 40)}`);
"""
SENTENCES = (
    "return [...document.querySelectorAll('#answer > .pair li, #answer > div:last-child li')]"
)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    path: Path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, full())
    return path.as_uri()


@pytest.mark.parametrize(
    ("media", "width"),
    [("print", 703), ("print", 725), ("screen", 820), ("screen", 1280)],
    ids=["A4", "Letter", "tablet", "desk"],
)
def test_nothing_is_cut(chromium: webdriver.Chrome, report: str, media: str, width: int) -> None:
    metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media})
    try:
        chromium.get(report)
        assert chromium.execute_script(CUT) == []
    finally:
        chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
        chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_three_sentences_stand_on_the_first_screen_and_the_others_one_step_away(
    chromium: webdriver.Chrome, report: str
) -> None:
    chromium.get(report)
    shown = chromium.execute_script(f"{SENTENCES}.filter(e => !e.closest('details')).length")
    folded = chromium.execute_script(f"{SENTENCES}.filter(e => e.closest('details')).length")
    assert shown == 3
    assert folded > 0
