"""`cell export` as an operator meets it: what it prints, what it refuses and how it says so."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import cv2
import pytest
from typer.testing import CliRunner

from calib.calibration import calibrate
from calib.calibration.mapping import as_mapping
from calib.chain.optics import COLUMN
from cell.cli.app import app
from cell.errors import InputError
from cell.verbs.export import export_calibration, read_calibration
from cell.verbs.export.hand_over import TEXTS
from tests.export.calibrations import FOCUS, MOVING, STILL, with_joint, write
from tests.paper.scene import ALPHA0, BETA0, mixed_scene

CAMERAS = (*TEXTS, "json")
"""Formats that say what the camera is; the others say where it is."""


def _export(folder: Path, content: dict[str, Any], tool: str, **options: Any) -> str:
    return export_calibration(read_calibration(write(folder, content)), tool, **options).text


def _alpha_beta(opencv_text: str) -> tuple[float, float]:
    flags = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
    storage = cv2.FileStorage(opencv_text, flags)
    matrix = storage.getNode("camera_matrix").mat()
    return float(matrix[0, 0]), float(matrix[1, 1])


@pytest.mark.parametrize("tool", CAMERAS)
def test_a_lens_that_stands_still_needs_no_distance(tool: str, tmp_path: Path) -> None:
    numbers = re.findall(r"\d+\.\d+", _export(tmp_path, STILL, tool))
    assert 4755.8123 in map(float, numbers)


@pytest.mark.parametrize("tool", CAMERAS)
def test_decentering_and_k3_of_a_joint_fit_are_written_or_refused(
    tool: str, tmp_path: Path
) -> None:
    decentred = {"p1": 0.0011231, "p2": -0.0007232}
    written = _export(tmp_path, with_joint(STILL, **decentred), tool)
    assert all(f"{value:.16e}"[:9] in _scientific(written) for value in decentred.values())
    content = with_joint(STILL, **decentred, k3=-0.0204233)
    if tool == "kalibr":
        with pytest.raises(InputError, match="coefficient k3"):
            _export(tmp_path, content, tool)
        return
    assert f"{-0.0204233:.16e}"[:9] in _scientific(_export(tmp_path, content, tool))


def _scientific(text: str) -> str:
    """Every number of a text in one notation."""
    numbers = re.findall(r"-?\d+\.\d*(?:e[-+]?\d+)?", text)
    return " ".join(f"{float(number):.16e}" for number in numbers)


@pytest.mark.parametrize("tool", [t for t in CAMERAS if t != "json"])
def test_a_focal_length_that_moves_is_refused_with_the_distances_to_choose(
    tool: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as refused:
        _export(tmp_path, MOVING, tool)
    words = str(refused.value)
    assert f"which {tool} cannot say" in words
    assert "--distance" in words
    assert "calibrated from 0.360 to 0.910 m" in words
    assert "4320.2 px at 0.360 m" in words
    assert "From 0.600 to 0.910 m it stands still" in words
    assert refused.value.exit_status == 2


def test_with_a_distance_the_law_gives_the_focal_length(tmp_path: Path) -> None:
    alpha, beta = _alpha_beta(_export(tmp_path, MOVING, "opencv", distance_m=0.5))
    assert alpha == pytest.approx(4760.0 - 57.0 / 0.25, abs=1e-9)
    assert beta / alpha == pytest.approx(4789.1456 / 4755.8123, abs=1e-12)


def test_the_joint_fit_s_own_law_goes_before_that_of_the_scale_factors(tmp_path: Path) -> None:
    content = with_joint(MOVING, focus=FOCUS)
    alpha, beta = _alpha_beta(_export(tmp_path, content, "opencv", distance_m=0.5))
    assert alpha == pytest.approx(4600.0 * 0.5 / (0.5 - 0.018), abs=1e-9)
    assert beta == pytest.approx(alpha * 1.01, abs=1e-9)


def test_beyond_a_corner_in_the_curve_zone_two_s_values_hold(tmp_path: Path) -> None:
    zones = MOVING["zones"] | {"method": "change_point"}
    content = MOVING | {"zones": zones}
    assert _alpha_beta(_export(tmp_path, content, "opencv", distance_m=0.7)) == (4700.0, 4705.0)
    near, _ = _alpha_beta(_export(tmp_path, content, "opencv", distance_m=0.5))
    assert near == pytest.approx(4532.0)


def test_json_says_how_the_focal_length_moves(tmp_path: Path) -> None:
    camera = json.loads(_export(tmp_path, with_joint(MOVING, focus=FOCUS), "json"))
    assert camera["schema"] == "cell.camera/1"
    assert camera["focus"]["law"] == "thin_lens"
    assert camera["focus"]["parameters"]["f_m"]["value"] == 0.018
    there = json.loads(_export(tmp_path, MOVING, "json", distance_m=0.5))
    assert (there["focus"], there["distance_m"]) == (None, 0.5)
    assert there["alpha_px"] == pytest.approx(4532.0)


def test_a_skewed_camera_is_refused_and_the_way_out_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"skew of 0\.3 px.*zhang_mle_no_skew"):
        _export(tmp_path, STILL, "ros", solution="zhang_mle")
    assert json.loads(_export(tmp_path, STILL, "json", solution="zhang_mle"))["skew_px"] == 0.3


def test_one_focal_length_for_a_lens_that_moves_comes_with_a_warning(tmp_path: Path) -> None:
    still = MOVING["solutions"]["zhang_mle"] | {"skew_px": 0.0}
    content = MOVING | {"solutions": {"zhang_mle": still}}
    source = read_calibration(write(tmp_path, content))
    exported = export_calibration(source, "colmap")
    assert "wrong nearly everywhere" in exported.warnings[0]


def test_a_distance_outside_what_was_calibrated_comes_with_a_warning(tmp_path: Path) -> None:
    source = read_calibration(write(tmp_path, MOVING))
    (warning,) = export_calibration(source, "ros", distance_m=2.0).warnings
    assert "outside the calibrated range, 0.360 to 0.910 m" in warning
    assert export_calibration(source, "ros", distance_m=0.9).warnings == ()


@pytest.mark.parametrize("distance_m", [0.0, -1.0, float("nan"), 0.05])
def test_a_distance_without_a_focal_length_is_refused(distance_m: float, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--distance"):
        _export(tmp_path, MOVING, "opencv", distance_m=distance_m)


def test_an_older_file_without_the_image_s_size_is_distinguished(tmp_path: Path) -> None:
    content = {key: value for key, value in STILL.items() if key != "image_size_px"}
    with pytest.raises(InputError, match="does not state the image's size"):
        _export(tmp_path, content, "kalibr")
    size = (1279, 724)
    assert "resolution: [1279, 724]" in _export(tmp_path, content, "kalibr", image_size_px=size)
    assert _alpha_beta(_export(tmp_path, content, "opencv"))[0] == 4755.8123


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is no JSON"),
        ('{"schema": "cell.plan/1"}', "is this the right file"),
        ('{"schema": "cell.calibration/1", "solutions": {"joint_ml": {"alpha_px": -1}}}',
         "alpha_px: Input should be greater than 0"),
        ('{"schema": "cell.calibration/1", "solutions": {}}', "has no solutions"),
    ],
)  # fmt: skip
def test_unusable_files_are_reported_with_the_place(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "calibration.json"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        export_calibration(read_calibration(path), "ros")


def test_the_verb_prints_the_file_writes_it_or_wraps_it_in_json(tmp_path: Path) -> None:
    write(tmp_path, STILL)
    runner = CliRunner()
    printed = runner.invoke(app, ["export", str(tmp_path), "--format", "colmap"])
    assert printed.exit_code == 0
    assert printed.stdout.splitlines()[-1].startswith("1 OPENCV 4096 3072 4755.8123 ")
    out = tmp_path / "cameras.txt"
    arguments = ["export", str(tmp_path), "--format", "colmap", "-o", str(out), "--json"]
    wrapped = json.loads(runner.invoke(app, arguments).stdout)
    assert out.read_text() == printed.stdout == wrapped["text"]


def test_a_missing_file_is_named_once(tmp_path: Path) -> None:
    path = tmp_path / "nothing.json"
    refused = CliRunner().invoke(app, ["export", str(path), "--format", "ros"])
    assert str(refused.exception).count(str(path)) == 1


def test_the_verb_reports_the_file_in_its_refusals(tmp_path: Path) -> None:
    path = write(tmp_path, MOVING)
    for arguments, words in (
        (["--format", "ros"], f"{path}: the focal length follows the distance"),
        (["--format", "halcon"], "known are ros, opencv, mrcal, kalibr, colmap, json"),
        (["--format", "ros", "--image-size", "big"], "must be WIDTHxHEIGHT, such as 4096x3072"),
        (["--format", "ros", "--solution", "mine"], "has no solution mine; it has zhang_mle"),
    ):
        refused = CliRunner().invoke(app, ["export", str(path), *arguments])
        assert isinstance(refused.exception, InputError)
        assert words in str(refused.exception)


def test_a_real_calibration_of_a_breathing_lens_is_handed_over_at_its_distance(
    tmp_path: Path,
) -> None:
    true = mixed_scene(noise_px=0.05, robot_mm=0.02, robot_deg=0.002, k_px_m2=50.0)
    content = as_mapping(calibrate(true.views), "bench")
    for row in (0, 6, 20):
        distance_m = float(true.depth_m[row])
        alpha, beta = _alpha_beta(_export(tmp_path, content, "opencv", distance_m=distance_m))
        assert alpha == pytest.approx(true.optics[row, COLUMN["alpha_px"]], abs=1.0)
        assert beta / alpha == pytest.approx(BETA0 / ALPHA0, abs=1e-4)
