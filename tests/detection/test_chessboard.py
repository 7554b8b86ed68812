import time

import cv2
import numpy as np
import pytest
from board_rendering import (
    best_order_px,
    localisation_bound_px,
    photograph,
    pose_homography,
    render_board,
)

from calib.detection import Rejected, detect, finder
from calib.views import Board

SHAPE = (480, 640)
CENTRE = (322.3, 241.6)


def chessboard(rows, cols):
    return Board("chessboard", rows, cols, 0.025)


def seen(rows, cols, *, square_px, seed=0, noise=2.0, shape=SHAPE, centre=CENTRE, **looks):
    pose = {k: looks.pop(k) for k in ("tilt_deg", "azimuth_deg", "roll_deg") if k in looks}
    H = pose_homography(rows, cols, square_px=square_px, centre=centre, f_px=1500, **pose)
    clean, truth = render_board(shape, H, rows, cols, **looks)
    return photograph(clean, noise=noise, seed=seed), truth, clean


@pytest.mark.parametrize(
    ("rows", "cols", "square_px", "blur_px"),
    [
        (7, 10, 40, 0.0),
        (7, 10, 40, 1.0),
        (7, 10, 40, 3.0),
        (7, 10, 40, 6.0),
        (14, 14, 24, 1.0),
        (14, 14, 24, 3.0),
        (14, 14, 24, 6.0),
    ],
)
def test_corners_reach_the_bound_that_noise_sets(rows, cols, square_px, blur_px):
    errors, scores, bounds, blurs = [], [], [], []
    for seed in range(3):
        image, truth, clean = seen(
            rows,
            cols,
            square_px=square_px,
            seed=seed,
            blur_px=blur_px,
            samples=16 if blur_px == 0 else 6,
            tilt_deg=15 * seed,
            azimuth_deg=130 * seed,
            roll_deg=7 + 10 * seed,
        )
        found = detect(image, chessboard(rows, cols))
        assert found, found.reason
        error = best_order_px(found.corners_px, truth, rows, cols)
        errors.append(error)
        scores.append(error / found.sigma_px.reshape(-1, 1))
        bounds.append(localisation_bound_px(clean, truth, rows, cols, np.hypot(2, 12**-0.5)))
        blurs.append(found.frame_blur_px)
    rms, bound = np.sqrt(np.mean(np.square(errors))), np.sqrt(np.mean(np.square(bounds)))
    assert rms <= 1.5 * bound
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 0.005
    assert np.median(blurs) == pytest.approx(blur_px, rel=0.02, abs=0.15)
    assert 0.8 < np.sqrt(np.mean(np.square(scores))) < 1.3


def test_lens_distortion_and_shading_do_not_move_corners():
    image, truth, _ = seen(
        7,
        10,
        square_px=52,
        noise=0.3,
        blur_px=2.0,
        k1=-0.25,
        shading=0.8,
        dark=30.0,
        contrast=110.0,
        tilt_deg=20,
        roll_deg=4,
        samples=10,
    )
    found = detect(image, chessboard(7, 10))
    assert found
    error = found.corners_px - truth
    assert np.sqrt(np.square(error).mean()) < 0.005
    assert np.abs(error).max() < 0.03


@pytest.mark.parametrize("azimuth_deg", [0, 50, 90])
def test_a_board_at_60_degrees_is_found(azimuth_deg):
    image, truth, _ = seen(
        7, 10, square_px=40, tilt_deg=60, azimuth_deg=azimuth_deg, roll_deg=20, blur_px=1.0
    )
    found = detect(image, chessboard(7, 10))
    assert found
    assert np.sqrt(np.square(found.corners_px - truth).mean()) < 0.015


@pytest.mark.parametrize("rows_cols", [(7, 10), (14, 14)])
def test_squares_of_eight_pixels_are_enough(rows_cols):
    image, truth, _ = seen(*rows_cols, square_px=8.2, tilt_deg=10, roll_deg=30, blur_px=0.8)
    found = detect(image, chessboard(*rows_cols))
    assert found
    error = best_order_px(found.corners_px, truth, *rows_cols)
    assert np.sqrt(np.square(error).mean()) < 0.03


@pytest.mark.parametrize("roll_deg", [0, 75, 155, 180, 235, 310])
def test_row_zero_is_the_side_with_two_dark_corner_squares(roll_deg):
    image, truth, _ = seen(7, 10, square_px=30, roll_deg=roll_deg + 3, tilt_deg=25, samples=4)
    found = detect(image, chessboard(7, 10))
    assert found
    assert found.upside_down_known
    assert np.abs(found.corners_px - truth).max() < 0.1


def test_columns_turn_clockwise_into_rows_even_if_nothing_names_the_ends():
    for rows, cols in ((7, 9), (6, 6)):
        image, truth, _ = seen(rows, cols, square_px=30, roll_deg=200, tilt_deg=30, samples=4)
        found = detect(image, chessboard(rows, cols))
        assert found
        assert not found.upside_down_known
        grid = found.corners_px.reshape(rows, cols, 2)
        across, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
        assert across[0] * down[1] - across[1] * down[0] > 0
        assert np.abs(best_order_px(found.corners_px, truth, rows, cols)).max() < 0.1


@pytest.mark.parametrize("blur_px", [0.0, 4.0])
def test_a_partial_view_is_rejected(blur_px):
    image, truth, _ = seen(
        7, 10, square_px=40, centre=(150.0, 240.0), roll_deg=2, blur_px=blur_px, samples=4
    )
    assert (truth[:, 0] < 0).sum() == 7
    rejected = detect(image, chessboard(7, 10))
    assert isinstance(rejected, Rejected)
    assert "63 of 70" in rejected.reason


def test_a_hidden_corner_is_not_made_up():
    image, truth, _ = seen(7, 10, square_px=40, tilt_deg=20, roll_deg=5, samples=4)
    x, y = np.rint(truth[34]).astype(int)
    image[y - 25 : y + 25, x - 25 : x + 25] = 90
    rejected = detect(image, chessboard(7, 10))
    assert isinstance(rejected, Rejected)
    assert "of 70 corners" in rejected.reason


@pytest.mark.parametrize("rows_cols", [(6, 9), (7, 9), (8, 10), (7, 11)])
def test_another_board_is_rejected(rows_cols):
    image, _, _ = seen(7, 10, square_px=40, tilt_deg=20, roll_deg=5, samples=4)
    rejected = detect(image, chessboard(*rows_cols))
    assert isinstance(rejected, Rejected)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 640), np.uint8),
        np.random.default_rng(0).integers(0, 255, (480, 640)).astype(np.uint8),
        np.full((20, 20), 7, np.uint8),
        np.tile(np.linspace(0, 255, 640).astype(np.uint8), (480, 1)),
    ],
)
def test_pictures_without_a_board_are_rejected_with_a_reason(image):
    rejected = detect(image, chessboard(7, 10))
    assert isinstance(rejected, Rejected)
    assert not rejected
    assert rejected.reason


def test_crossings_without_order_are_turned_down_before_any_fit(monkeypatch):
    monkeypatch.setattr(finder, "fit_grid", lambda *_, **__: pytest.fail("fitted chance"))
    coarse = np.random.default_rng(1).uniform(-1, 1, (60, 80)).astype(np.float32)
    field = cv2.resize(coarse, (960, 720), interpolation=cv2.INTER_CUBIC)
    image = np.clip(128 + 100 * np.clip(5 * field, -1, 1), 0, 255).astype(np.uint8)
    rejected = detect(image, chessboard(5, 6))
    assert isinstance(rejected, Rejected)
    assert "no rows and columns" in rejected.reason


def test_colour_and_sixteen_bits_are_read_alike():
    image, _, _ = seen(7, 10, square_px=40, tilt_deg=20, roll_deg=5, samples=4)
    grey = detect(image, chessboard(7, 10))
    colour = detect(np.repeat(image[..., None], 3, axis=2), chessboard(7, 10))
    deep = detect(image.astype(np.uint16) * 200, chessboard(7, 10))
    assert grey
    assert colour
    assert deep
    np.testing.assert_allclose(colour.corners_px, grey.corners_px, atol=1e-4)
    np.testing.assert_allclose(deep.corners_px, grey.corners_px, atol=1e-3)


def test_overexposure_is_measured():
    image, _, clean = seen(7, 10, square_px=40, samples=4)
    fine, burnt = (
        detect(image, chessboard(7, 10)),
        detect(photograph(clean * 1.4), chessboard(7, 10)),
    )
    assert fine
    assert burnt
    assert fine.saturated < 0.01
    assert burnt.saturated > 0.9


def test_glare_costs_neither_the_board_nor_a_hundredth_of_a_pixel():
    _, truth, clean = seen(7, 10, square_px=40, tilt_deg=20, roll_deg=5, blur_px=1.0)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    glare = 45 * np.exp(-((x - 300) ** 2 + (y - 250) ** 2) / (2 * 60.0**2))
    found = detect(photograph(clean * 0.95 + glare), chessboard(7, 10))
    assert found
    assert np.sqrt(np.square(found.corners_px - truth).mean()) < 0.01


def test_twelve_megapixels_take_less_than_a_second_even_without_a_board():
    H = pose_homography(
        7, 10, square_px=150, centre=(2000, 1500), tilt_deg=30, roll_deg=5, f_px=5000
    )
    clean, truth = render_board((3072, 4096), H, 7, 10, blur_px=3.0, samples=2)
    image = photograph(clean)
    detect(image[:724, :1279], chessboard(7, 10))
    begin = time.process_time()
    found = detect(image, chessboard(7, 10))
    with_board = time.process_time() - begin
    begin = time.process_time()
    detect(image[:1300], chessboard(7, 10))
    without = time.process_time() - begin
    assert found
    assert np.sqrt(np.square(found.corners_px - truth).mean()) < 0.008
    assert with_board < 1.0
    assert without < 3.0
