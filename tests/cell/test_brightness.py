import numpy as np
import pytest

from cell.verbs.diagnose.brightness import _trend, white_level


def board_picture(white, dtype):
    image = np.full((60, 80), 0.1)
    image[20:40, 20:60] = np.where(np.arange(40) // 5 % 2, white, 0.05)
    return (image * np.iinfo(dtype).max).astype(dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_white_is_that_of_the_board_and_not_of_its_surroundings(dtype):
    corners = np.array([[20.0, 20.0], [59.0, 39.0], [np.nan, np.nan]])
    assert white_level(board_picture(0.7, dtype), corners) == pytest.approx(0.7, abs=0.01)


def test_light_that_falls_with_distance_is_reported_and_scatter_is_not():
    rng = np.random.default_rng(3)
    distance_m = rng.uniform(0.3, 1.0, 30)
    scatter = rng.normal(0, 0.01, 30)
    (reported,) = _trend(
        0.6 * (1 - 0.2 * (distance_m - 0.3)) + scatter, distance_m, "with distance"
    )
    assert "-1" in reported
    assert reported.endswith("% with distance")
    assert _trend(0.6 + scatter, distance_m, "with distance") == ()
