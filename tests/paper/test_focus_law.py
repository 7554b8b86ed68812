import numpy as np
import pytest

from calib.errors import CalibrationError
from calib.paper.focus_law import choose_focus_law, fit_focus_law

DISTANCE = np.geomspace(0.3, 2.0, 16)


def _noisy(scale: np.ndarray, seed: int = 0, sigma: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return scale + rng.normal(0, sigma, len(scale)), np.full(len(scale), sigma)


@pytest.mark.parametrize("k", [18.0, -18.0])
def test_inverse_square_is_found_with_its_sign(k: float) -> None:
    scale, sigma = _noisy(4755.8 - k / DISTANCE**2)
    choice = choose_focus_law(DISTANCE, scale, sigma)
    assert choice is not None
    assert choice.preferred.law == "inverse_square"
    assert choice.decisive
    fitted = choice.preferred.parameters
    assert abs(fitted["k_px_m2"].value - k) < 3 * fitted["k_px_m2"].sigma
    assert abs(fitted["alpha0_px"].value - 4755.8) < 3 * fitted["alpha0_px"].sigma


@pytest.mark.parametrize("f_m", [0.018, -0.018])
def test_thin_lens_is_found(f_m: float) -> None:
    scale, sigma = _noisy(3272.7 * DISTANCE / (DISTANCE - f_m))
    choice = choose_focus_law(DISTANCE, scale, sigma)
    assert choice is not None
    assert choice.preferred.law == "thin_lens"
    assert choice.decisive
    fitted = choice.preferred.parameters["f_m"]
    assert abs(fitted.value - f_m) < 3 * fitted.sigma


def test_a_constant_is_kept_and_rarely_mistaken() -> None:
    kept = 0
    for seed in range(100):
        scale, sigma = _noisy(np.full(16, 4755.8), seed)
        choice = choose_focus_law(DISTANCE, scale, sigma)
        assert choice is not None
        kept += choice.preferred.law == "constant"
    assert kept >= 97


def test_a_lens_that_obeys_no_law_on_offer_is_reported() -> None:
    scale, sigma = _noisy(4755.8 - 60 * np.exp(-(((DISTANCE - 0.8) / 0.15) ** 2)))
    choice = choose_focus_law(DISTANCE, scale, sigma)
    assert choice is not None
    assert not choice.decisive
    assert "none fits" in choice.why


def test_too_few_views_give_no_law() -> None:
    assert choose_focus_law(DISTANCE[:4], np.ones(4), np.ones(4)) is None
    with pytest.raises(CalibrationError, match="distances"):
        fit_focus_law("thin_lens", np.full(6, 0.5), np.ones(6), np.ones(6))


def test_the_distances_common_error_widens_sigma() -> None:
    scale, sigma = _noisy(4755.8 - 18 / DISTANCE**2)
    plain = fit_focus_law("inverse_square", DISTANCE, scale, sigma)
    wide = fit_focus_law(
        "inverse_square",
        DISTANCE,
        scale,
        sigma,
        per_distance_px_m=scale / DISTANCE,
        common_distance_sigma_m=1e-3,
    )
    for name in plain.parameters:
        assert wide.parameters[name].value == plain.parameters[name].value
        assert wide.parameters[name].sigma > 2 * plain.parameters[name].sigma


def test_sigma_covers_the_truth() -> None:
    pulls = []
    for seed in range(200):
        scale, sigma = _noisy(4755.8 - 18 / DISTANCE**2, seed)
        k = fit_focus_law("inverse_square", DISTANCE, scale, sigma).parameters["k_px_m2"]
        pulls.append((k.value - 18) / k.sigma)
    assert np.std(pulls) == pytest.approx(1.07, abs=0.17)
