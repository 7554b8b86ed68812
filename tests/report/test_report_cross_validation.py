"""The report states what cross-validation found, or why there is none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from html import unescape
from typing import Any

import made_up_cell

from calib.calibration import Calibration, calibrate
from calib.calibration.mapping import as_mapping
from cell.views.report.sections.limitations import sentences
from cell.views.report.sections.uncertainty import uncertainty
from cell.views.terminal.summary import calibration_summary
from tests.paper.scene import mixed_scene


@cache
def _calibrated() -> Calibration:
    return calibrate(mixed_scene(noise_px=0.1, robot_mm=0.03, robot_deg=0.003).views)


def _content(**changes: Any) -> dict[str, Any]:
    return as_mapping(_calibrated(), "bench") | changes


def _page(content: dict[str, Any]) -> str:
    return unescape(uncertainty(replace(made_up_cell.full(9), calibration=content)))


def test_the_verdict_stands_on_the_first_screen_in_its_section_and_in_the_terminal() -> None:
    content = _content()
    why = content["cross_validation"]["why"]
    assert why in sentences(replace(made_up_cell.full(9), calibration=content))
    assert why in _page(content)
    assert f"cross-validation: {why}" in calibration_summary(content)


def test_every_quantity_and_what_is_held_out_is_in_a_table() -> None:
    page = _page(_content())
    for words in ("focal length α", "principal point", "camera's place", "board's turn"):
        assert f'<th scope="row">{words}' in page
    assert "robot's poses, χ² per degree of freedom" in page
    assert "Frames that carry an estimate" not in page


def test_frames_that_carry_an_estimate_are_listed() -> None:
    found = _content()["cross_validation"]
    pull = {"frame": 17, "quantity": "alpha_px", "sigmas": 2.34, "z": 6.1}
    page = _page(_content(cross_validation=found | {"influential_frames": [pull]}))
    assert "Frames that carry an estimate (1)" in page
    assert '<th scope="row">frame 17</th><td>focal length α</td><td>2.3</td>' in page


def test_without_it_the_reason_is_reported() -> None:
    content = _content(cross_validation=None, missing={"cross_validation": "9 frames took part"})
    reported = "Not cross-validated: 9 frames took part."
    assert reported in _page(content)
    assert reported in sentences(replace(made_up_cell.full(9), calibration=content))
    assert "not cross-validated: 9 frames took part" in calibration_summary(content)


def test_without_the_robot_only_its_section_says_so() -> None:
    content = _content(cross_validation=None, missing={}, robot=None)
    assert "Not cross-validated: no joint fit." in _page(content)
    first = " ".join(sentences(replace(made_up_cell.full(9), calibration=content)))
    assert "cross-validated" not in first + calibration_summary(content)
