"""The report states the camera's own uncertainty and what the views cannot distinguish."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from html import unescape
from typing import Any

import made_up_cell
import numpy as np
import pytest

from calib.calibration import calibrate
from calib.calibration.mapping import as_mapping
from cell.views.numbers import millimetres
from cell.views.report import ReportData
from cell.views.report.sections.answer import answer
from cell.views.report.sections.limitations import sentences
from cell.views.report.sections.tables import tables
from cell.views.report.sections.uncertainty import quantity_names, uncertainty
from cell.views.report.workpiece_error import of_solution
from tests.paper.scene import scene


@cache
def _written(near_m: float = 0.595, far_m: float = 0.605) -> str:
    """A calibration from views of hardly more than one distance, or of several."""
    rng = np.random.default_rng(0)
    true = scene(
        distance_m=rng.uniform(near_m, far_m, 25),
        tilt_deg=rng.uniform(15, 40, 25),
        noise_px=0.05,
        k1=-0.05,
        robot_mm=0.05,
        robot_deg=0.005,
    )
    return json.dumps(as_mapping(calibrate(true.views), "bench"))


def _data(**changes: Any) -> ReportData:
    return replace(made_up_cell.full(9), calibration=json.loads(_written()) | changes)


def test_what_is_not_separable_stands_on_the_first_screen_and_in_its_section() -> None:
    data = _data()
    assert data.calibration is not None
    (weak,) = data.calibration["not_separable"]
    for words in (" ".join(sentences(data)), unescape(uncertainty(data))):
        assert "focal length's change with distance" in words
        assert weak["separate_with"] in words


def test_views_that_distinguish_all_are_reported_so() -> None:
    spread = json.loads(_written(0.3, 1.0))
    assert spread["not_separable"] == []
    page = uncertainty(replace(_data(), calibration=spread))
    assert "distinguish all fitted quantities" in page
    assert "hardly distinguish" not in " ".join(sentences(replace(_data(), calibration=spread)))


def test_the_millimetres_are_those_of_the_file() -> None:
    data = _data(cross_validation=None)
    assert data.calibration is not None
    found = data.calibration["uncertainty"]
    nearest = np.sqrt((np.array(found["workpiece_sigma_m"][0]) ** 2).sum(axis=1).mean())
    assert f"puts a part off by {millimetres(float(nearest))} at 0.59" in " ".join(sentences(data))
    page = uncertainty(data)
    assert page.count("<tr>") == 1 + 4 + 1 + 15 + 1 + 1
    across = 1e3 * np.sqrt((np.array(found["workpiece_sigma_m"][3])[:, :2] ** 2).sum(1).mean())
    cells = [float(c) for c in re.findall(r"<td>([\d.]+)</td>", page)]
    assert any(c == pytest.approx(across, rel=0.06) for c in cells)


def test_without_a_joint_fit_it_says_so() -> None:
    page = uncertainty(_data(uncertainty=None, not_separable=[], robot=None))
    assert "uncertainty is not known" in page
    assert "Without a joint fit" in page


def test_the_table_has_decentering_only_where_a_fit_freed_it() -> None:
    content = json.loads(_written())
    assert "p₁" not in tables(replace(_data(), calibration=content))
    joint = content["solutions"]["joint_ml"]
    joint |= {"p1": 0.0011, "p2": -0.0007, "sigma": joint["sigma"] | {"p1": 2e-5, "p2": 2e-5}}
    page = tables(replace(_data(), calibration=content))
    assert "p₁" in page
    assert "0.001100 ± 0.000020" in page
    assert "held at 0" in page
    assert "k₃" not in page


def test_the_first_sentence_counts_what_all_pictures_share() -> None:
    data = _data()
    assert data.calibration is not None
    found = data.calibration["uncertainty"]
    shared = np.sqrt((np.linalg.norm(found["workpiece_sigma_m"], axis=2) ** 2).mean(axis=1)).max()
    best = of_solution(data, str(data.recommended))
    assert best is not None
    allows = float(np.hypot(best.p95_m, 2 * shared))
    assert allows > 1.1 * best.p95_m
    page = unescape(answer(data))
    assert f"for work that allows {millimetres(allows)} at the work piece" in page
    assert f"may be off by {millimetres(2 * shared)} (two sigma)" in page


def test_numbers_that_go_together_are_reported_as_a_reader_knows_them() -> None:
    assert quantity_names(["flange_from_camera.z", "base_from_camera.rx", "v0_px", "focal"]) == [
        "the camera's place along z on the flange",
        "the camera's turn about x in the base",
        "the principal point v0",
        "focal",
    ]
