"""The fit with a free pose for each frame: truth, OpenCV's optimum, and an honest covariance."""

import cv2
import numpy as np
import pytest

from calib.chain.optics import COLUMN
from calib.chain.rigid import from_vector, to_vector
from calib.solver.free_poses import FreePoseFit, fit_free_poses
from calib.solver.unknowns import PLAIN_OPTICS
from tests.paper.scene import ALPHA0, BETA0, BOARD, HEIGHT, U0, V0, WIDTH, Scene, mixed_scene

TRUE = {"alpha_px": ALPHA0, "beta_px": BETA0, "u0_px": U0, "v0_px": V0, "k1": -0.08, "k2": 0.03}


def _scene(noise_px: float, seed: int = 1) -> Scene:
    return mixed_scene(noise_px=noise_px, k1=-0.08, k2=0.03, seed=seed)


def _fit(true: Scene, *, disturbed: bool = True) -> FreePoseFit:
    """Start a per cent off in the lens and some millimetres in the poses."""
    optics, poses = true.optics.copy(), true.camera_from_board
    if disturbed:
        rng = np.random.default_rng(7)
        optics[:, [COLUMN["alpha_px"], COLUMN["beta_px"]]] *= 1.01
        optics[:, [COLUMN["k1"], COLUMN["k2"]]] = 0.0
        poses = from_vector(rng.normal(0, 5e-3, (len(poses), 6))) @ poses
    corners = true.views.corners_px
    return fit_free_poses(optics, poses, BOARD.corners_m, corners, PLAIN_OPTICS)


def test_without_noise_the_truth_comes_back() -> None:
    true = _scene(0.0)
    fit = _fit(true)
    assert fit.converged
    for name, value in TRUE.items():
        assert fit.optics[0, COLUMN[name]] == pytest.approx(value, rel=1e-7, abs=1e-7)
    off = to_vector(fit.camera_from_board @ np.linalg.inv(true.camera_from_board))
    assert np.abs(off).max() < 1e-7


def test_the_optimum_is_opencv_s() -> None:
    true = _scene(0.1)
    fit = _fit(true)
    points = [BOARD.corners_m.astype(np.float32)] * len(true.views)
    seen = [c.astype(np.float32) for c in true.views.corners_px]
    start = np.array([[ALPHA0 * 1.01, 0, U0], [0, BETA0 * 1.01, V0], [0, 0, 1]])
    flags = cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_USE_INTRINSIC_GUESS
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-15)
    rms, A, k, *_ = cv2.calibrateCamera(
        points, seen, (WIDTH, HEIGHT), start, np.zeros(5), flags=flags, criteria=criteria
    )
    ours = fit.optics[0]
    # OpenCV takes single-precision corners: 1e-4 px of rounding at the far end of the image
    for name, value in zip(PLAIN_OPTICS[:4], (A[0, 0], A[1, 1], A[0, 2], A[1, 2]), strict=True):
        assert ours[COLUMN[name]] == pytest.approx(value, abs=2e-3), name
    assert ours[COLUMN["k1"]] == pytest.approx(k[0], abs=1e-5)
    assert np.sqrt(2 * np.mean(fit.residual_px**2)) == pytest.approx(rms, abs=1e-5)


def test_corners_that_were_not_seen_or_weigh_nothing_do_not_count() -> None:
    true = _scene(0.1)
    corners = true.views.corners_px.copy()
    corners[:, ::7] += 40.0
    weight = np.ones(corners.shape[:2])
    weight[:, ::7] = 0.0
    args = (true.optics, true.camera_from_board, BOARD.corners_m)
    weighed = fit_free_poses(*args, corners, PLAIN_OPTICS, weight=weight)
    corners[:, ::7] = np.nan
    missing = fit_free_poses(*args, corners, PLAIN_OPTICS)
    assert np.allclose(weighed.optics, missing.optics, rtol=1e-9)
    assert np.isnan(missing.residual_px[:, ::7]).all()


def test_its_covariance_is_what_repetition_scatters_by() -> None:
    runs = [_fit(_scene(0.1, seed), disturbed=False) for seed in range(120)]
    columns = [COLUMN[name] for name in PLAIN_OPTICS]
    # one frame's own geometry is drawn anew with every seed, so each run is held to its own sigma
    truth = np.array([TRUE[name] for name in PLAIN_OPTICS])
    error = np.array([run.optics[0, columns] - truth for run in runs])
    sigma = np.array([np.sqrt(np.diag(run.covariance)) for run in runs])
    pull = np.sqrt(np.mean((error / sigma) ** 2, axis=0))
    # 120 runs fix a standard deviation to 6.5 %: four of that
    assert np.all((pull > 0.74) & (pull < 1.26)), pull
    whole = [e @ np.linalg.solve(run.covariance, e) for e, run in zip(error, runs, strict=True)]
    assert np.mean(whole) == pytest.approx(6.0, abs=4 * np.sqrt(12 / 120))
    noise = np.array([run.sigma_px for run in runs])
    assert noise.mean() == pytest.approx(0.1, rel=0.005)
