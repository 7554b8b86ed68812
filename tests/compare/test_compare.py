"""`cell compare`: the same camera twice agrees, another one does not, and by how much."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from calib.calibration import calibrate
from calib.calibration.mapping import as_mapping
from calib.chain.rigid import from_vector
from cell.cli.app import app
from cell.errors import InputError
from cell.storage.files.provenance import provenance
from cell.verbs.compare import Side, compare, side_of
from cell.verbs.compare.field import differences, field_of
from cell.verbs.compare.page import render
from cell.verbs.compare.side import NAMES, PLACE
from cell.verbs.compare.sources import source_of
from cell.verbs.export import CalibrationSource
from tests.export.calibrations import MOVING, STILL, with_joint, write
from tests.paper.scene import mixed_scene


@cache
def _content(seed: int, k_px_m2: float = 0.0, mount: str = "eye_in_hand") -> str:
    true = mixed_scene(
        seed=seed,
        noise_px=0.1,
        robot_mm=0.03,
        robot_deg=0.003,
        k_px_m2=k_px_m2,
        k1=-0.05,
        mount=mount,
    )
    header = {"created": "2026-11-29T13:00:00+01:00", "camera": {"model": "eye", "serial": "C7"}}
    found = as_mapping(calibrate(true.views), f"run {seed}")
    origin = provenance(header)
    return json.dumps(found | origin | {"robot": (found.get("robot") or {}) | origin["robot"]})


def _calibrated(seed: int, k_px_m2: float = 0.0, mount: str = "eye_in_hand") -> Side:
    content = CalibrationSource.model_validate_json(_content(seed, k_px_m2, mount))
    return side_of(content, f"run {seed}")


def _side(content: dict[str, Any]) -> Side:
    return side_of(CalibrationSource.model_validate(content), "a test")


def test_two_runs_of_one_camera_agree_and_chance_is_as_large_as_foretold() -> None:
    found = compare(_calibrated(1), _calibrated(2))
    assert found.mounted is not None
    for part in (found.camera, found.mounted):
        assert part.beyond_chance is False
        assert part.p_value is not None
        for row in part.rows:
            assert row.rms_px < 3 * row.by_chance_px
            assert abs(row.depth_mm) < 4 * row.depth_sigma_mm


def test_two_runs_of_a_breathing_camera_agree_too() -> None:
    found = compare(_calibrated(1, 50.0), _calibrated(2, 50.0))
    assert found.a.law == "inverse_square"
    assert found.camera.beyond_chance is False


def test_a_fixed_camera_is_compared_in_the_robot_s_base() -> None:
    found = compare(*(_calibrated(seed, mount="eye_to_hand") for seed in (1, 2)))
    assert found.a.place_name == "base_from_camera"
    assert found.a.correlated
    assert (np.diag(found.a.covariance)[PLACE] > 0).all()
    assert found.mounted is not None
    assert found.mounted.beyond_chance is False


def _moved(side: Side, **changes: float) -> Side:
    names = ["alpha", "beta", "bend", "u0_px"]
    values = side.values.copy()
    for name, change in changes.items():
        values[names.index(name)] += change
    return replace(side, values=values)


def test_a_focal_length_off_by_a_thousandth_is_reported_in_pixels_and_millimetres() -> None:
    a = _calibrated(1)
    share = 1e-3
    found = compare(a, _moved(a, alpha=share * a.values[0], beta=share * a.values[1]))
    assert found.camera.beyond_chance
    far = found.camera.rows[-1]
    assert far.depth_mm == pytest.approx(1e3 * share * far.distance_m, rel=1e-6)
    assert found.mounted is not None
    row = found.mounted.rows[0]
    corner = np.hypot(*(row.worst_at_px - a.values[3:5]))
    assert row.worst_px == pytest.approx(share * corner, rel=0.1)
    across_mm = 1e3 * row.distance_m * row.worst_px / a.values[0]
    assert row.worst_lateral_mm == pytest.approx(across_mm, rel=0.01)


def test_a_camera_that_was_knocked_is_the_same_camera_mounted_elsewhere() -> None:
    a = _calibrated(1)
    assert a.place is not None
    knock = np.array([0.0005, 0.0, 0.0002, 0.0, 0.002, 0.0])
    found = compare(a, replace(a, place=a.place @ from_vector(knock)))
    assert found.camera.rows[0].rms_px < 1e-6
    assert found.camera.beyond_chance is False
    assert found.mounted is not None
    assert found.mounted.beyond_chance
    assert found.mounted.rows[0].depth_mm == pytest.approx(0.2, rel=0.01)


def test_a_lens_that_began_to_breathe_is_found() -> None:
    found = compare(_calibrated(1), _calibrated(2, 50.0))
    assert found.camera.beyond_chance
    near, far = found.camera.rows[0], found.camera.rows[-1]
    assert near.depth_mm == pytest.approx(-1e3 * 0.3 * 50.0 / 4755.8 / 0.3**2, rel=0.05)
    assert abs(far.depth_mm) < abs(near.depth_mm)


def test_without_covariances_it_says_that_chance_is_a_guess() -> None:
    sigma = {"alpha_px": 0.5, "beta_px": 0.5, "u0_px": 1.0, "v0_px": 1.0, "k1": 1e-3, "k2": 1e-2}
    content = with_joint(STILL, sigma=sigma)
    found = compare(_side(content), _side(content))
    assert found.mounted is None
    assert "only single sigmas are known" in " ".join(found.notes)
    assert found.camera.beyond_chance is False


def test_an_uncertainty_that_its_own_frames_call_too_small_is_reported() -> None:
    sure = replace(_calibrated(1), label="new", too_sure=2.6)
    notes = " ".join(compare(_calibrated(1), sure).notes)
    assert "new: its own frames ask for up to 2.6 times the uncertainty it states" in notes
    assert not any("own frames" in n for n in compare(_calibrated(1), _calibrated(2)).notes)
    reported = STILL | {"cross_validation": {"verdict": "sigma_too_small", "factor": 2.6}}
    assert _side(reported).too_sure == 2.6


def test_without_any_uncertainty_it_does_not_judge() -> None:
    found = compare(_side(MOVING), _side(with_joint(MOVING, u0_px=2055.0)))
    assert found.camera.beyond_chance is None
    assert found.camera.rows[0].p_value is None
    assert found.camera.rows[0].rms_px > 0.1


MORE = {"p1": 0.0011, "p2": -0.0007, "k3": -0.02}


def test_every_distortion_coefficient_has_its_part_in_the_difference() -> None:
    plain, more = _side(STILL), _side(with_joint(STILL, **MORE))
    centre_px = np.array([2052.3, 1548.5])
    camera = np.array([[4755.8123, 0.0, 2052.3], [0.0, 4789.1456, 1548.5], [0.0, 0.0, 1.0]])
    field = field_of(plain, more)
    ahead = (np.eye(4), np.eye(4))
    found = differences(plain, more, field, (plain.values, more.values), ahead)[0]
    seen, _ = cv2.projectPoints(
        field.points_m[0],
        np.zeros(3),
        np.zeros(3),
        camera,
        np.array([-0.11, 0.057, *MORE.values()]),
    )
    assert np.abs(found - (seen[:, 0] - field.pixels)).max() < 1e-6
    assert np.abs(found).max() > 1.0
    back = field_of(more, plain)
    again = more.pixels(more.values, back.points_m[0], float(back.distances_m[0]), np.eye(4))
    assert np.abs(again - back.pixels).max() < 1e-6
    assert np.linalg.norm(back.pixels - centre_px, axis=1).max() > 2000.0


def test_what_chance_does_to_decentering_and_k3_counts() -> None:
    names = ("alpha_px", "beta_px", "u0_px", "v0_px", "k1", "k2", *MORE)
    sigma = np.array([0.5, 0.5, 1.0, 1.0, 1e-3, 1e-2, 3e-5, 3e-5, 5e-3])
    covariance = {"names": names, "matrix": np.diag(sigma**2).tolist()}
    content = with_joint(STILL, **MORE, covariance=covariance)
    side = _side(content)
    freed = [NAMES.index(name) for name in MORE]
    assert np.sqrt(np.diag(side.covariance)[freed]) == pytest.approx(sigma[-3:])
    held = {"names": names[:6], "matrix": np.diag(sigma[:6] ** 2).tolist()}
    without = _side(with_joint(STILL, **MORE, covariance=held))
    row, less = (compare(s, s).camera.rows[0] for s in (side, without))
    assert row.by_chance_px > 1.01 * less.by_chance_px


def test_a_law_of_the_scale_factors_is_compared_as_exported() -> None:
    alpha, beta = _side(MOVING).scale_px(_side(MOVING).values, 0.5)
    assert alpha == pytest.approx(4760.0 - 57.0 / 0.25)
    assert beta / alpha == pytest.approx(4789.1456 / 4755.8123)


def test_a_corner_in_the_focal_length_is_noted() -> None:
    cornered = MOVING | {"zones": MOVING["zones"] | {"method": "change_point"}}
    assert "corner at the edge of zone 2" in " ".join(compare(_side(cornered), _side(MOVING)).notes)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"image_size_px": [1280, 720]}, "not the same camera"),
        ({"distance_range_m": [1.2, 3.0]}, "no distance to compare"),
        ({"image_size_px": None}, "Run cell calibrate anew"),
    ],
)
def test_what_cannot_be_compared_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        compare(_side(STILL), _side(STILL | change))


def test_the_page_stands_alone_with_a_map_for_each_part() -> None:
    page = render(compare(_calibrated(1), _calibrated(2)))
    assert page.count("<svg role") == 2
    assert "agree within their uncertainty" in page
    assert "<link" not in page
    assert "<script" not in page
    assert page.count("Recorded 2026-11-29T13:00:00+01:00; camera eye (serial C7)") == 2
    assert page.count("by calibration-cell ") == 2


def test_the_verb_takes_files_and_folders_and_speaks_json(tmp_path: Path) -> None:
    folders = [tmp_path / "one", tmp_path / "two" / "calibration"]
    for folder, seed in zip(folders, (1, 2), strict=True):
        folder.mkdir(parents=True)
        (folder / "calibration.json").write_text(_content(seed))
    page = tmp_path / "page.html"
    arguments = ["compare", str(folders[0] / "calibration.json"), str(tmp_path / "two")]
    reported = CliRunner().invoke(app, [*arguments, "-o", str(page)])
    assert reported.exit_code == 0
    assert "As mounted on the robot (hand-eye included): they agree" in reported.stdout
    assert page.stat().st_size > 20_000
    output = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)
    assert output["schema"] == "cell.comparison/1"
    assert output["a"]["camera"] == {"model": "eye", "serial": "C7"}
    assert output["a"]["program"].startswith("calibration-cell ")
    assert output["mounted"]["beyond_chance"] is False
    assert np.shape(output["camera"]["difference_px"]) == (4, 63, 2)


def test_a_folder_that_is_neither_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"recording\.yaml"):
        source_of(tmp_path)


def test_a_recording_is_calibrated_on_the_way(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from types import SimpleNamespace

    write(tmp_path, STILL)
    mapping = json.loads((tmp_path / "calibration.json").read_text())
    (tmp_path / "calibration.json").unlink()
    monkeypatch.setattr("cell.storage.recording.read_recording", lambda path: path)
    monkeypatch.setattr(
        "cell.verbs.calibrate.calibrate_recording", lambda path: SimpleNamespace(mapping=mapping)
    )
    assert source_of(tmp_path).recording == "bench"
    assert list(tmp_path.iterdir()) == []
