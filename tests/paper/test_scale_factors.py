import numpy as np
import pytest

from calib.errors import CalibrationError
from calib.paper.scale_factors import paper_scale_factor, scale_factor
from tests.paper.scene import ALPHA0, BETA0, BOARD, U0, V0, scene

PLANE = BOARD.corners_m[:, :2]


@pytest.mark.parametrize("tilt_deg", [0.0, 0.5, 5.0, 12.0])
def test_exact_at_any_small_tilt_and_roll(tilt_deg: float) -> None:
    true = scene(distance_m=np.array([0.3, 0.7, 2.0]), tilt_deg=np.full(3, tilt_deg))
    for corners, depth in zip(true.views.corners_px, true.depth_m, strict=True):
        found = scale_factor(PLANE, corners, depth, (U0, V0))
        assert found.alpha_px == pytest.approx(ALPHA0, abs=1e-3)
        assert found.beta_px == pytest.approx(BETA0, abs=1e-3)
        assert np.degrees(found.tilt_rad) == pytest.approx(tilt_deg, abs=0.01)


def test_the_printed_estimator_is_off_where_the_view_is_tilted() -> None:
    true = scene(distance_m=np.array([0.5]), tilt_deg=np.array([8.0]))
    alpha, _ = paper_scale_factor(PLANE, true.views.corners_px[0], true.depth_m[0], BOARD.cols)
    assert abs(alpha - ALPHA0) > 5.0


def test_sigma_covers_the_truth_and_beats_the_printed_estimator() -> None:
    pulls, errors, printed = [], [], []
    for seed in range(200):
        true = scene(distance_m=np.array([0.6]), tilt_deg=np.array([0.3]), seed=seed, noise_px=0.2)
        corners, depth = true.views.corners_px[0], true.depth_m[0]
        found = scale_factor(PLANE, corners, depth, (U0, V0))
        pulls.append((found.alpha_px - ALPHA0) / found.alpha_sigma_px)
        errors.append(found.alpha_px - ALPHA0)
        square_on = np.linalg.norm(np.diff(corners.reshape(7, 10, 2), axis=1), axis=2)
        printed.append(square_on.mean() * depth / BOARD.square_m - ALPHA0)
    assert np.std(pulls) == pytest.approx(1.0, abs=0.15)
    assert abs(np.mean(pulls)) < 0.3
    assert np.std(errors) < 0.85 * np.std(printed)


def test_an_offset_of_all_distances_is_reported_as_what_it_does() -> None:
    true = scene(distance_m=np.array([0.3]), tilt_deg=np.array([0.0]))
    corners, depth = true.views.corners_px[0], true.depth_m[0]
    right = scale_factor(PLANE, corners, depth, (U0, V0))
    short = scale_factor(PLANE, corners, depth - 0.010, (U0, V0))
    expected = right.alpha_px - 0.010 * right.alpha_per_distance_px_m
    assert short.alpha_px == pytest.approx(expected, abs=0.01)
    assert short.alpha_px == pytest.approx(ALPHA0 * (1 - 0.010 / 0.3), rel=1e-4)


def test_bad_distances_and_empty_views_are_refused() -> None:
    corners = scene(distance_m=np.array([0.3]), tilt_deg=np.array([0.0])).views.corners_px[0]
    with pytest.raises(CalibrationError, match="not positive"):
        scale_factor(PLANE, corners, -0.3, (U0, V0))
    with pytest.raises(CalibrationError, match="corners"):
        scale_factor(PLANE, np.full_like(corners, np.nan), 0.3, (U0, V0))
