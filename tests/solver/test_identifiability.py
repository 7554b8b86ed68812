"""What the views cannot separate is named, with views that would."""

import numpy as np
import pytest

from calib.calibration import Calibration, calibrate
from calib.views import FloatArray, Mount
from tests.paper.scene import scene


def _calibrated(
    distance_m: FloatArray, tilt_deg: FloatArray, mount: Mount = "eye_in_hand"
) -> Calibration:
    true = scene(
        distance_m=distance_m,
        tilt_deg=tilt_deg,
        noise_px=0.05,
        k1=-0.05,
        robot_mm=0.05,
        robot_deg=0.005,
        mount=mount,
    )
    return calibrate(true.views)


def test_tilted_views_over_the_distances_separate_everything() -> None:
    rng = np.random.default_rng(0)
    assert _calibrated(rng.uniform(0.3, 1.0, 40), rng.uniform(0, 40, 40)).weaknesses == ()


def test_views_of_one_distance_leave_open_whether_the_focus_moves() -> None:
    rng = np.random.default_rng(0)
    found = _calibrated(rng.uniform(0.595, 0.605, 25), rng.uniform(15, 40, 25))
    (weakness,) = found.weaknesses
    together = {"focal length", "focal length's change with distance"}
    assert set(weakness.quantities) == together
    assert weakness.inflation > 100
    assert "distances from" in weakness.views
    assert weakness.gain > 10


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
def test_hardly_tilted_views_mix_up_where_camera_and_board_are_along_the_axis(
    mount: Mount,
) -> None:
    rng = np.random.default_rng(0)
    found = _calibrated(np.linspace(0.3, 1.0, 25), rng.uniform(0, 4, 25), mount)
    camera, board = ("flange_from_camera", "base_from_board")
    if mount == "eye_to_hand":
        camera, board = "base_from_camera", "flange_from_board"
    named = {name for weakness in found.weaknesses for name in weakness.quantities}
    assert {f"{camera}.z", f"{board}.z"} <= named
    worst = found.weaknesses[0]
    assert "tilted 30 degrees" in worst.views
    assert worst.gain > 3
