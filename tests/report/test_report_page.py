"""The report is one file that stands alone; it says the key numbers and what it does not know."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import made_up_cell
import pytest

from calib.views import Views
from cell.storage.files.calibration_file import CalibrationFile
from cell.storage.files.diagnosis_file import DiagnosisFile
from cell.views.report import ReportData, write_report
from cell.views.terminal.summary import diagnosis_summary

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Strict(HTMLParser):
    """Checks that tags nest, and collects what a browser would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.text: list[str] = []
        self.ids: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        self._note(attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._note(attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def _note(self, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "href", "xlink:href"):
                self.loads.append(value or "")
            if name == "id":
                self.ids.append(value or "")


def parsed(data: ReportData, folder: Path) -> tuple[Strict, str]:
    path = folder / "report.html"
    write_report(path, data)
    page = path.read_text(encoding="utf-8")
    parser = Strict()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser, " ".join(" ".join(parser.text).split())


@pytest.fixture(scope="module")
def full_page(tmp_path_factory: pytest.TempPathFactory) -> tuple[Strict, str]:
    return parsed(made_up_cell.full(), tmp_path_factory.mktemp("full"))


def test_the_made_up_results_have_the_shape_of_the_real_files() -> None:
    CalibrationFile.model_validate(made_up_cell.full(9).calibration)
    DiagnosisFile.model_validate(made_up_cell.diagnosis())


def test_it_loads_nothing_from_outside(full_page: tuple[Strict, str]) -> None:
    parser, _ = full_page
    assert parser.loads
    assert all(load.startswith(("#", "data:image/")) for load in parser.loads)


def test_every_reference_inside_the_page_has_its_target(tmp_path: Path) -> None:
    parser, _ = parsed(made_up_cell.full(9), tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    wanted = {load[1:] for load in parser.loads if load.startswith("#")}
    wanted |= set(re.findall(r"url\(#([^)]+)\)", page))
    assert wanted <= set(parser.ids)


@pytest.mark.parametrize(
    "words",
    [
        "SIMULATED",
        "robotiq_wrist on the flange of ur5e",
        "Recorded 2026-11-29T13:00:00+01:00; camera robotiq_wrist (serial 4711), robot ur5e (serial"
        " not known). This result: 2026-11-29T14:00:00+01:00, by calibration-cell 0.1.0.",
        "1370.83 ± 0.22 px",  # alpha of the recommended solution
        "1373.11 ± 0.21 px",  # alpha0 of the focus law
        "5.980 ± 0.050 px·m²",
        "0.118 px",  # held-out after
        "noise floor 0.104 px",
        "joint 3 = (2.10 ± 0.20)·10⁻⁵ rad/Nm",
        "the camera 0.32 mm RMS off",
        "cell run separate.yaml",
        "12.300 ± 0.011 mm",  # flange_from_camera x
        "blurred: edge blur 3.1 px <limit>",
        "do not judge by reprojection",
        "3f9a…",
    ],
)
def test_the_key_numbers_are_there(full_page: tuple[Strict, str], words: str) -> None:
    assert words in full_page[1]


def test_every_drawing_is_there_and_none_is_missing(full_page: tuple[Strict, str]) -> None:
    _, text = full_page
    for title in ("α (px)", "from above", "z — enlarged", "histogram", "tilts", "held-out frames"):
        assert title in text
    assert "Not drawn" not in text


def test_a_solution_that_reprojects_well_and_is_far_off_is_called_so(
    full_page: tuple[Strict, str],
) -> None:
    found = re.search(r"yet it is ([\d.]+) mm off", full_page[1])
    assert found
    assert 20 < float(found.group(1)) < 40


def test_without_robot_pictures_and_diagnosis_it_says_so(tmp_path: Path) -> None:
    data = made_up_cell.full(9)
    blank = Views.blank(
        data.views.board, width_px=data.views.width_px, height_px=data.views.height_px, frames=9
    )
    views = replace(blank, corners_px=data.views.corners_px)
    bare = {"solutions": {"zhang_mle": {"alpha_px": 1319.7}}, "frames_rejected": []}
    parser, text = parsed(
        ReportData(views=views, recording={"name": "bare"}, calibration=bare), tmp_path
    )
    for words in (
        "Flange poses were not logged",
        "No diagnosis was made",
        "No scale factors were measured",
        "Pictures were not kept",
        "error at the work piece is not known",
    ):
        assert words in text
    assert "SIMULATED" not in text
    assert not any(load.startswith("data:image/jpeg") for load in parser.loads)


def test_a_diagnosis_alone_makes_a_report(tmp_path: Path) -> None:
    data = replace(made_up_cell.full(9), calibration=None, residuals_px={}, poses={})
    _, text = parsed(data, tmp_path)
    assert "No calibration was made here" in text
    assert "focus breathing (inverse square)" in text
    assert "Not drawn" not in text
    _, text = parsed(replace(data, evidence=None), tmp_path)
    assert "Not drawn: it needs each frame's camera pose" in text


def test_what_is_unexplained_warns_in_the_first_sentence(tmp_path: Path) -> None:
    left = {
        "link": "mount",
        "site": "mounted_pose",
        "covariate": "gravity_x",
        "p_value": 1e-12,
        "where": "upright",
        "law": {
            "form": "linear",
            "equation": "mounted_pose.x_m = constant +0.0003 (gravity_x - 0) [m]",
            "covariates": ["gravity_x"],
            "parameters": {"slope_x_m": {"value": 3e-4, "sigma": 1e-5, "unit": "m/g"}},
            "holdout_gain_px": 0.31,
            "rivals": ["step: mounted_pose along order (3.0 behind)"],
        },
    }
    data = made_up_cell.full(9)
    reported = made_up_cell.diagnosis(
        verdict="unexplained", unexplained=left, unexplained_all=[left]
    )
    data = replace(data, diagnosis=reported)
    _, text = parsed(data, tmp_path)
    assert "With care" in text
    assert "mounted on the flange moves in proportion to gravity x, upright" in text
    assert "Look at what holds the camera" in text
    assert "the bracket's screws" in text
    assert "0.31 px worse without" in text
    assert "0.0002804 to 0.0003196" in text
    assert "step: mounted_pose along order (3.0 behind)" in text


def test_text_from_files_is_escaped(tmp_path: Path) -> None:
    data = replace(made_up_cell.full(9), recording={"name": "<script>alert(1)</script>"})
    parsed(data, tmp_path)
    assert "<script" not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_long_recording_makes_a_page_one_can_mail(tmp_path: Path) -> None:
    data = made_up_cell.full(60)
    write_report(tmp_path / "report.html", data)
    assert (tmp_path / "report.html").stat().st_size < 5e6


def test_the_terminal_says_what_has_no_name_and_where_to_look() -> None:
    law = {"form": "linear", "equation": "principal_point.u_px = +0.6 (gain_db - 3) [px]",
           "covariates": ["gain_db"], "parameters": {}, "rivals": []}  # fmt: skip
    left = {"link": "lens", "site": "principal_point", "covariate": "gain_db", "p_value": 1e-9,
            "where": "all of it", "law": law}  # fmt: skip
    lost = {"link": "bookkeeping", "site": "frames", "covariate": "order", "p_value": 1e-9,
            "where": "5 frames between 3 and 7 contradict the others", "law": None}  # fmt: skip
    reported = made_up_cell.diagnosis(verdict="unexplained", unexplained_all=[left, lost])
    lines = diagnosis_summary(reported)
    assert "principal point) moves in proportion to gain_db; no known effect" in lines
    assert "+0.6 (gain_db - 3) [px]" in lines
    assert "automatic gain and exposure" in lines
    assert "5 frames between 3 and 7" in lines
    assert "Look at these frames' pictures" in lines
