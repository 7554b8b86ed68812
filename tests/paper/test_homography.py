import numpy as np
import pytest
from scipy.optimize import least_squares

from calib.errors import CalibrationError
from calib.paper.homography import apply_homography, fit_homography, linear_homography
from calib.views import FloatArray

PLANE = np.stack(np.meshgrid(np.arange(10), np.arange(7)), axis=-1).reshape(-1, 2) * 0.025
TRUE = np.array([[4000.0, 300.0, 900.0], [-250.0, 4100.0, 700.0], [0.4, -0.3, 1.0]])
PIXELS = apply_homography(TRUE, PLANE)


def test_linear_start_is_exact_without_noise() -> None:
    assert np.allclose(linear_homography(PLANE, PIXELS), TRUE, rtol=1e-9, atol=1e-7)


def test_the_printed_sign_of_eq_19_gives_a_negated_third_row() -> None:
    ones = np.column_stack([PLANE, np.ones(len(PLANE))])
    zero = np.zeros_like(ones)
    rows = np.concatenate(
        [
            np.hstack([ones, zero, PIXELS[:, :1] * ones]),
            np.hstack([zero, ones, PIXELS[:, 1:] * ones]),
        ]
    )
    printed = np.linalg.svd(rows)[2][8].reshape(3, 3)
    printed = printed / -printed[2, 2]
    assert np.allclose(printed[2], -TRUE[2], atol=1e-4)
    assert np.allclose(printed[:2], TRUE[:2], rtol=1e-4)


def test_wrong_corners_are_left_out() -> None:
    rng = np.random.default_rng(3)
    noisy = PIXELS + rng.normal(0, 0.1, PIXELS.shape)
    spoilt = noisy.copy()
    spoilt[[3, 40, 66]] += [[8.0, 0.0], [0.0, -5.0], [3.0, 3.0]]
    fit = fit_homography(PLANE, spoilt)
    assert set(np.flatnonzero(~fit.inlier)) == {3, 40, 66}
    assert np.abs(apply_homography(fit.matrix, PLANE) - PIXELS).max() < 0.12
    assert fit.sigma_px == pytest.approx(0.1, rel=0.25)


def test_covariance_covers_the_truth() -> None:
    rng = np.random.default_rng(4)
    chi2 = []
    for _ in range(200):
        fit = fit_homography(PLANE, PIXELS + rng.normal(0, 0.1, PIXELS.shape))
        off = (fit.matrix - TRUE).ravel()[:8]
        scale = np.sqrt(np.diag(fit.covariance))
        whitened = off / scale
        chi2.append(whitened @ np.linalg.solve(fit.covariance / np.outer(scale, scale), whitened))
    assert np.mean(chi2) == pytest.approx(8.0, abs=1.0)


def test_corners_on_a_line_are_refused() -> None:
    line = np.column_stack([np.arange(9) * 0.1, np.zeros(9)])
    with pytest.raises(CalibrationError, match="line"):
        linear_homography(line, line * 1000 + 5)


def test_the_fit_ends_where_another_program_s_least_squares_does() -> None:
    rng = np.random.default_rng(5)
    sigma = rng.uniform(0.5, 2.0, len(PLANE))
    noisy = PIXELS + rng.normal(0, 0.1, PIXELS.shape) * sigma[:, None]
    fit = fit_homography(PLANE, noisy, sigma)
    assert fit.inlier.all()

    def residual(first_eight: FloatArray) -> FloatArray:
        matrix = np.append(first_eight, 1.0).reshape(3, 3)
        off = noisy - apply_homography(matrix, PLANE)
        return np.asarray((off / sigma[:, None]).ravel())

    other = least_squares(
        residual, TRUE.ravel()[:8], x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15
    )
    one_sigma = np.sqrt(np.diag(fit.covariance))
    assert np.abs((fit.matrix.ravel()[:8] - other.x) / one_sigma).max() < 1e-5


def test_corners_that_nearly_fix_no_homography_do_not_stop_it() -> None:
    line = np.column_stack([np.arange(12) * 0.025, np.tile([0.0, 1e-7], 6)])
    fit = fit_homography(line, apply_homography(TRUE, line))
    assert np.abs(apply_homography(fit.matrix, line) - apply_homography(TRUE, line)).max() < 1e-3
