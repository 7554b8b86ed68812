"""Wrong corners, a frame in the wrong order, a frame with another's pose: found and harmless."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from calib.calibration import calibrate
from calib.calibration.mapping import as_mapping
from calib.views import BoolArray, FloatArray, Mount, Views
from cell.storage.files.calibration_file import CalibrationFile
from tests.paper.scene import mixed_scene

TURNED, MIRRORED, OTHERS_POSE = 9, 12, 17


@cache
def _clean(mount: Mount) -> Views:
    return mixed_scene(
        noise_px=0.1, k_px_m2=50.0, k1=-0.05, robot_mm=0.03, robot_deg=0.003, mount=mount
    ).views


def _spoilt(views: Views) -> tuple[Views, BoolArray]:
    """5 % of the corners off by 5 px, and three frames wrong; and which corners are off."""
    rng = np.random.default_rng(5)
    corners, flange = views.corners_px.copy(), views.base_from_flange.copy()
    wrong = np.asarray(rng.random(corners.shape[:2]) < 0.05)
    angle = rng.uniform(0, 2 * np.pi, int(wrong.sum()))
    corners[wrong] += 5.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners[TURNED], wrong[TURNED] = corners[TURNED, ::-1], wrong[TURNED, ::-1]
    grid = corners[MIRRORED].reshape(views.board.rows, views.board.cols, 2)
    corners[MIRRORED] = grid.transpose(1, 0, 2).reshape(-1, 2)
    flange[OTHERS_POSE] = flange[5]
    return replace(views, corners_px=corners, base_from_flange=flange), wrong


def _alpha_px(joint: dict[str, Any], distance_m: float) -> tuple[float, float]:
    """Scale factor at a distance, and its sigma."""
    law, covariance = joint["focus"]["parameters"], joint["covariance"]
    at = [covariance["names"].index(name) for name in ("alpha0_px", "k_px_m2")]
    gradient = np.array([1.0, -1.0 / distance_m**2])
    value = gradient @ [law["alpha0_px"]["value"], law["k_px_m2"]["value"]]
    variance = gradient @ np.array(covariance["matrix"])[np.ix_(at, at)] @ gradient
    return float(value), float(np.sqrt(variance))


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_everything_wrong_is_found_and_reported_and_nothing_else(mount: Mount) -> None:
    clean = _clean(mount)
    spoilt, wrong = _spoilt(clean)
    found = calibrate(spoilt)
    content = as_mapping(found, "bench")
    CalibrationFile.model_validate(content)
    assert [r["frame"] for r in content["frames_rejected"]] == [MIRRORED]
    assert "wrong detection" in content["frames_rejected"][0]["reason"]
    assert content["robot"]["outliers"] == [TURNED, OTHERS_POSE]
    reported = np.zeros_like(wrong)
    for one in content["corners_left_out"]:
        reported[one["frame"], one["corners"]] = True
    wrong[MIRRORED] = False
    assert reported[wrong].all()
    assert not reported[~wrong].any()


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_the_estimates_take_no_harm(mount: Mount) -> None:
    clean = _clean(mount)
    spoilt, _ = _spoilt(clean)
    before, after = calibrate(clean), calibrate(spoilt)
    one, other = (as_mapping(c, "bench") for c in (before, after))
    one, other = one["solutions"]["joint_ml"], other["solutions"]["joint_ml"]
    for name in ("u0_px", "v0_px", "k1", "k2"):
        assert abs(other[name] - one[name]) < 1.5 * one["sigma"][name], name
    for distance_m in (0.35, 0.6, 1.0):
        was, sigma = _alpha_px(one, distance_m)
        assert abs(_alpha_px(other, distance_m)[0] - was) < 1.5 * sigma, distance_m
    assert other["reprojection_px"]["rms"] < 0.15
    poses = (c.solutions["joint_ml"].camera_from_board for c in (before, after))
    assert _largest_depth_change_m(*poses) < 5e-4


def _largest_depth_change_m(one: FloatArray, other: FloatArray) -> float:
    kept = [i for i in range(len(one)) if i not in (TURNED, MIRRORED, OTHERS_POSE)]
    return float(np.abs(one[kept, 2, 3] - other[kept, 2, 3]).max())


def test_a_lens_that_bends_its_edges_loses_no_good_corner() -> None:
    # edges miss their homography by many sigma; they are not wrong
    bent = mixed_scene(noise_px=0.1, k1=-0.9, k2=0.5).views
    assert as_mapping(calibrate(bent), "bench")["corners_left_out"] == []
