"""With CELL_NO_SKIP=1 (continuous integration) a skipped test fails unless no machine like this
could run it."""

from __future__ import annotations

import os
import platform
from collections.abc import Generator

import pytest

from cell.compiled import forget_stale, write_in_turn

forget_stale()
write_in_turn()

MAY_SKIP = (
    "all tests already run as an ordinary user",
    "an ordinary user may not read",
    "setpriv (util-linux) is missing",
    # the installer ran before and found neither a Python for it nor PyPI
    "mrcal is not installed",
    *(() if platform.machine() == "x86_64" else ("pycolmap has no wheel for this machine",)),
)
"""How the reasons of those tests begin that may be skipped even so."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with long tests come first: at the end no process waits for them."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def _refuse(report: pytest.TestReport | pytest.CollectReport) -> None:
    if os.environ.get("CELL_NO_SKIP") != "1" or not report.skipped or hasattr(report, "wasxfail"):
        return
    where = report.longrepr
    reason = str(where[2] if isinstance(where, tuple) else where).removeprefix("Skipped: ")
    if not reason.startswith(MAY_SKIP):
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid}: skipped, which CELL_NO_SKIP=1 forbids: {reason}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    _refuse(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    _refuse(report)
    return report
