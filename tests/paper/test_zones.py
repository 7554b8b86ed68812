import numpy as np
import pytest

from calib.paper.focus_law import choose_focus_law
from calib.paper.zones import Zones, find_zones

DISTANCE = np.linspace(0.25, 2.7, 30)


def _zones(
    alpha: np.ndarray, sigma: np.ndarray, distance: np.ndarray = DISTANCE
) -> tuple[Zones | None, str]:
    choice = choose_focus_law(distance, alpha, sigma)
    return find_zones(distance, alpha, sigma, alpha * 1.001, sigma, choice)


def _with_corner(seed: int, sigma: float = 0.5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    bend = np.maximum(0, 1 / DISTANCE**2 - 1 / 0.7**2)
    return 4755.8 - 18 * bend + rng.normal(0, sigma, len(DISTANCE))


def test_the_paper_s_near_limit_is_found_within_its_sigma() -> None:
    inside = 0
    for seed in range(20):
        zones, _ = _zones(_with_corner(seed), np.full(len(DISTANCE), 0.5))
        assert zones is not None
        assert zones.method == "change_point"
        assert zones.near_sigma_m is not None
        assert zones.near_limit_m == pytest.approx(0.7, abs=0.1)
        inside += abs(zones.near_limit_m - 0.7) < 2 * zones.near_sigma_m
        assert zones.alpha_px == pytest.approx(4755.8, abs=4 * zones.alpha_sigma_px)
    assert inside >= 16


def test_a_smooth_law_has_no_corner_and_says_so() -> None:
    rng = np.random.default_rng(5)
    alpha = 4755.8 - 2.0 / DISTANCE**2 + rng.normal(0, 0.1, len(DISTANCE))
    zones, why = _zones(alpha, np.full(len(DISTANCE), 0.1))
    assert zones is not None
    assert zones.method == "tolerance"
    assert zones.near_limit_m == pytest.approx(np.sqrt(2.0 / 4.7558), rel=0.02)
    assert "no corner" in why


def test_a_focus_that_moves_everywhere_gives_none_with_the_reason() -> None:
    rng = np.random.default_rng(5)
    alpha = 4755.8 - 60 / DISTANCE**2 + rng.normal(0, 0.1, len(DISTANCE))
    zones, why = _zones(alpha, np.full(len(DISTANCE), 0.1))
    assert zones is None
    assert "zone 1" in why


def test_a_fixed_lens_has_bounds_only() -> None:
    rng = np.random.default_rng(6)
    zones, _ = _zones(4755.8 + rng.normal(0, 0.5, len(DISTANCE)), np.full(len(DISTANCE), 0.5))
    assert zones is not None
    assert (zones.near_is_bound, zones.far_is_bound) == (True, True)


def test_zone_3_starts_where_one_view_is_worth_less_than_the_tolerance() -> None:
    rng = np.random.default_rng(7)
    sigma = 4.7558 * (DISTANCE / 1.8)
    zones, _ = _zones(4755.8 + rng.normal(0, 1, len(DISTANCE)) * sigma, sigma)
    assert zones is not None
    assert zones.far_limit_m == pytest.approx(1.8, abs=0.05)


def test_zone_3_starts_where_the_scatter_jumps() -> None:
    rng = np.random.default_rng(8)
    scatter = np.where(DISTANCE > 1.9, 5.0, 0.5)
    zones, _ = _zones(4755.8 + rng.normal(0, 1, len(DISTANCE)) * scatter, np.full(30, 0.5))
    assert zones is not None
    assert zones.far_limit_m == pytest.approx(1.9, abs=0.2)


def test_too_few_views_give_none_with_the_reason() -> None:
    zones, why = _zones(_with_corner(0)[:4], np.full(4, 0.5), DISTANCE[:4])
    assert zones is None
    assert "need 6" in why
