"""Every effect has its picture, and the picture needs no more than the data it names."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import made_up_cell
import pytest

from calib.chain.effects import catalogue
from cell.views.report.data import ReportData
from cell.views.report.evidence import EVIDENCE, picture_of, remedy_of
from cell.views.report.evidence.arm import named_joint

BOOKKEEPING = (
    "frame_pose_offset",
    "frame_pose_swap",
    "length_unit",
    "rotation_convention",
    "robot_model",
)
CATALOGUE = [(e.name, e.law, e.link) for e in catalogue()]
EFFECTS = CATALOGUE + [(name, None, "bookkeeping") for name in BOOKKEEPING]


def entry(name: str, law: str | None, link: str) -> dict[str, Any]:
    return {"name": name, "law": law, "link": link, "parameters": {}}


@pytest.fixture(scope="module")
def data() -> ReportData:
    return made_up_cell.full(18)


@pytest.mark.parametrize(("name", "law", "link"), EFFECTS)
def test_it_has_a_picture_of_its_own_and_a_remedy(name: str, law: str | None, link: str) -> None:
    assert name in EVIDENCE
    assert remedy_of(entry(name, law, link))


@pytest.mark.parametrize("name", sorted(EVIDENCE))
def test_the_picture_is_drawn_from_full_data(data: ReportData, name: str) -> None:
    figure = EVIDENCE[name].draw(data, entry(name, None, "lens"))
    assert figure is not None
    drawn = ElementTree.fromstring(figure.svg(name)).iter("{http://www.w3.org/2000/svg}path")
    assert sum(path.attrib["d"].count("M") for path in drawn) > 50


@pytest.mark.parametrize("name", sorted(EVIDENCE))
def test_without_measurements_nothing_is_drawn(data: ReportData, name: str) -> None:
    bare = replace(data, evidence=None)
    assert EVIDENCE[name].draw(bare, entry(name, None, "lens")) is None


def test_an_effect_nobody_registered_gets_the_drawing_of_its_link() -> None:
    assert picture_of(entry("gremlins", None, "arm")) is EVIDENCE["arm"]
    assert picture_of(entry("gremlins", None, "nowhere")) is None


def test_the_joint_that_stands_out_is_named() -> None:
    parameters = {
        "offset_rad_2": {"value": 3e-4, "sigma": 3e-4},
        "offset_rad_4": {"value": -2e-4, "sigma": 1e-5},
    }
    assert named_joint({"parameters": parameters}) == 4
    assert named_joint({"parameters": {"k_px_m2": {"value": 1.0, "sigma": 0.1}}}) is None


def test_a_warp_is_drawn_from_its_own_law_where_no_corner_was_measured(data: ReportData) -> None:
    assert data.evidence is not None
    data = replace(data, evidence=replace(data.evidence, board_offset_m=None))
    warp = entry("board_warp", None, "board")
    assert EVIDENCE["board_warp"].draw(data, warp) is None
    warp["parameters"] = {"bend_x_m": {"value": 5e-4, "sigma": 1e-5, "unit": "m"}}
    figure = EVIDENCE["board_warp"].draw(data, warp)
    assert figure is not None
    (low, high) = figure.axes[0].key_limits
    assert high == -low == pytest.approx(0.5, rel=0.03)
