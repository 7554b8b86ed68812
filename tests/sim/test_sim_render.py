"""Rendered pictures against the chain's own projection, by estimators of the test's own.

Corners are measured without the product's detector. Along a pixel row that crosses one edge, the
row's sum of grey values gives where the edge crosses that row, to the last digit, because each
pixel integrates over its square. A parabola through those crossings on both arms of a corner is
the printed line; two lines meet in the corner.
"""

import time

import cv2
import numpy as np
import pytest

from calib.chain import rigid
from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.views import Board
from sim.render import Blur, Sensor, expose, render
from sim.render.coverage import _half_plane
from sim.render.pattern import BACKGROUND, BLACK, WHITE

CHESS = Board("chessboard", 7, 10, 0.025)


def pose(rotvec, translation):
    return rigid.compose(np.array([rotvec]), np.array([translation]))[0]


def camera(width, height, alpha, **more):
    given = {"alpha_px": alpha, "beta_px": 1.004 * alpha, "u0_px": width / 2 - 3.3}
    return optics_row(**{**given, "v0_px": height / 2 + 2.1, "height_px": height, **more})


def line_through(image, corner, along, slopes, reach, half):
    """Parabola of the edge that runs roughly along axis `along` (0: columns, 1: rows).

    The strips summed start far enough from the corner not to touch the other edge.
    """
    near, far = int(abs(slopes[1 - along]) * half) + half, int(reach)
    assert far > near + 4
    places, crossings = [], []
    for step in [*range(-far, -near + 1), *range(near, far + 1)]:
        place = round(corner[1 - along]) + step
        expected = corner[along] + slopes[along] * (place - corner[1 - along])
        low, high = round(expected) - half, round(expected) + half
        strip = image[place, low : high + 1] if along == 0 else image[low : high + 1, place]
        first, last = float(strip[0]), float(strip[-1])
        share = (float(strip.astype(float).sum()) - len(strip) * last) / (first - last)
        places.append(place - corner[1 - along])
        crossings.append(low - 0.5 + share - corner[along])
    return np.polyfit(places, crossings, 2)


def measured_corner(image, corner, slopes, reach, half):
    steep = line_through(image, corner, 0, slopes, reach, half)
    flat = line_through(image, corner, 1, slopes, reach, half)
    x = y = 0.0
    for _ in range(20):
        x, y = np.polyval(steep, y), np.polyval(flat, x)
    return corner + np.array([x, y])


def corner_errors(image, truth, board, half=4):
    """Measured minus true corners ((rows - 2) (cols - 2), 2), those with four whole arms."""
    grid = truth.reshape(board.rows, board.cols, 2)
    errors = []
    for row in range(1, board.rows - 1):
        for col in range(1, board.cols - 1):
            down = grid[row + 1, col] - grid[row - 1, col]
            right = grid[row, col + 1] - grid[row, col - 1]
            steep, flat = (down, right) if abs(down[1]) > abs(down[0]) else (right, down)
            reach = 0.45 * min(abs(steep[1]), abs(flat[0])) / 2
            slopes = (steep[0] / steep[1], flat[1] / flat[0])
            corner = measured_corner(image, grid[row, col], slopes, reach, half)
            errors.append(corner - grid[row, col])
    return np.array(errors)


CASES = {
    "wrist camera, straight on": (1279, 724, 1370.8, {}, [0, 0, 0], [-0.112, -0.075, 0.36], None),
    "wrist camera, barrel, tilted": (
        1279,
        724,
        1370.8,
        {"k1": -0.12, "k2": 0.08, "p1": 0.001, "skew_px": 0.4},
        [0.35, -0.3, 0.25],
        [-0.10, -0.06, 0.42],
        None,
    ),
    "12 megapixels, upside down": (
        4096,
        3072,
        4755.8,
        {"k1": -0.05, "k2": 0.1},
        [0.3, 0.25, 3.0],
        [0.11, 0.05, 0.50],
        None,
    ),
    "12 megapixels, warped board": (
        4096,
        3072,
        4755.8,
        {"k1": 0.03, "tilt_x_rad": 0.004},
        [-0.3, 0.3, -0.1],
        [-0.11, -0.06, 0.55],
        0.003,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_corners_are_where_the_chain_puts_them_to_a_thousandth_of_a_pixel(name):
    width, height, alpha, more, rotvec, translation, warp_m = CASES[name]
    optics, seen_from = camera(width, height, alpha, **more), pose(rotvec, translation)
    points = CHESS.corners_m.copy()
    if warp_m is not None:
        points[:, 2] += warp_m * ((points[:, 0] - 0.11) / 0.11) ** 2
    image = render(CHESS, points, optics, seen_from, width_px=width, height_px=height)
    truth = project(optics[None], seen_from[None], points)[0]
    errors = corner_errors(image, truth, CHESS)
    assert len(errors) == 40
    assert np.sqrt((errors**2).mean()) < 0.001


def test_corners_stay_put_under_defocus():
    width, height, alpha, _, rotvec, translation, _ = CASES["wrist camera, barrel, tilted"]
    optics, seen_from = camera(width, height, alpha), pose(rotvec, translation)
    blur = Blur(aperture_m=0.004, focus_distance_m=0.36, lens_sigma_px=0.5)
    image = render(
        CHESS, CHESS.corners_m, optics, seen_from, width_px=width, height_px=height, blur=blur
    )
    truth = project(optics[None], seen_from[None], CHESS.corners_m)[0]
    errors = corner_errors(image, truth, CHESS, half=7)
    assert np.sqrt((errors**2).mean()) < 0.01


def test_edge_coverage_equals_counting_points():
    rng = np.random.default_rng(3)
    grid = (np.arange(800) + 0.5) / 800 - 0.5
    for _ in range(20):
        a, b, offset = rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(-1, 1)
        counted = (a * grid[:, None] + b * grid[None] < offset).mean()
        assert _half_plane(offset, a, b) == pytest.approx(counted, abs=2e-3)


def test_colours_distinguish_the_ends():
    """The squares beyond corners (0, 0) and (0, cols - 1) are dark, those of the last row light."""
    optics, seen_from = camera(1279, 724, 1000.0), pose([0, 0, 0], [-0.112, -0.075, 0.4])
    image = render(CHESS, CHESS.corners_m, optics, seen_from, width_px=1279, height_px=724)
    middles = np.array(
        [[-0.5, -0.5], [9.5, -0.5], [-0.5, 6.5], [9.5, 6.5], [-1.5, -1.5], [11.5, 3]]
    )
    points = np.column_stack([middles * CHESS.square_m, np.zeros(6)])
    u, v = np.rint(project(optics[None], seen_from[None], points)[0]).astype(int).T
    expected = [BLACK, BLACK, WHITE, WHITE, WHITE, BACKGROUND]
    np.testing.assert_allclose(image[v, u], expected, atol=1e-6)


def edge_spread(image, u, v):
    """Gaussian-equivalent width of the dark-light edge at (u, v), from its derivative's moments."""
    profile = np.abs(np.diff(image[v - 3 : v + 4, u - 25 : u + 26].astype(float).mean(axis=0)))
    x = np.arange(len(profile))
    mean = (x * profile).sum() / profile.sum()
    return np.sqrt((((x - mean) ** 2) * profile).sum() / profile.sum())


@pytest.mark.parametrize("focus_m", [0.25, 0.33, 0.55])
def test_blur_is_the_circle_of_confusion(focus_m):
    """A disk of radius R has a standard deviation of R/2 along any axis."""
    depth, alpha, aperture = 0.4, 1370.8, 0.009
    optics, seen_from = camera(1279, 724, alpha), pose([0, 0, 0], [-0.112, -0.075, depth])
    blur = Blur(aperture, focus_m, lens_sigma_px=0.4)
    image = render(
        CHESS, CHESS.corners_m, optics, seen_from, width_px=1279, height_px=724, blur=blur
    )
    points = np.array([[4 * 0.025, 2.5 * 0.025, 0.0]])
    u, v = np.rint(project(optics[None], seen_from[None], points)[0, 0]).astype(int)
    radius = aperture * alpha * abs(1 / depth - 1 / focus_m) / 2
    # the pixel's square, the kernel's smallest disk, and the difference taken: a twelfth each
    expected = np.sqrt(radius**2 / 4 + 0.4**2 + 3 / 12)
    assert edge_spread(image, u, v) == pytest.approx(expected, rel=0.04)


def test_opencv_finds_its_own_charuco_board():
    board = Board("charuco", 4, 6, 0.03, 0.022, "DICT_5X5_100")
    optics, seen_from = camera(1279, 724, 1370.8), pose([0.2, -0.2, 0.1], [-0.08, -0.05, 0.4])
    image = render(board, board.corners_m, optics, seen_from, width_px=1279, height_px=724)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    layout = cv2.aruco.CharucoBoard((7, 5), 0.03, 0.022, dictionary)
    picture = expose(image, Sensor(), exposure_s=0.01)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(layout).detectBoard(picture)
    assert sorted(np.ravel(ids)) == list(range(24))
    truth = project(optics[None], seen_from[None], board.corners_m)[0][np.ravel(ids)]
    assert np.sqrt(((corners.reshape(-1, 2) - truth) ** 2).mean()) < 0.1


def test_noise_is_that_of_photons_and_readout():
    sensor = Sensor(full_well_e=8000, read_noise_levels=0.5, falloff=0, gradient_x=0, gradient_y=0)
    even = np.full((400, 500), 0.5, np.float32)
    picture = expose(
        even, sensor, exposure_s=sensor.white_exposure_s, rng=np.random.default_rng(1)
    ).astype(float)
    assert picture.mean() == pytest.approx(127.5, abs=0.1)
    per_count = 8000 / 255
    expected = np.sqrt(4000 / per_count**2 + 0.5**2 + 1 / 12)
    assert picture.std() == pytest.approx(expected, rel=0.02)


def test_exposure_and_gain_scale_the_picture_and_it_saturates():
    sensor = Sensor(falloff=0, gradient_x=0, gradient_y=0)
    even = np.full((4, 4), 0.5, np.float32)
    half = expose(even, sensor, exposure_s=sensor.white_exposure_s / 2)
    amplified = expose(even, sensor, exposure_s=sensor.white_exposure_s / 2, gain_db=6.0206)
    flooded = expose(even, sensor, exposure_s=sensor.white_exposure_s * 5)
    assert (half == 64).all()
    assert (amplified == 127).all() | (amplified == 128).all()
    assert (flooded == 255).all()


def test_a_board_out_of_sight_leaves_background():
    optics = camera(1279, 724, 1370.8)
    behind = render(
        CHESS, CHESS.corners_m, optics, pose([0, 0, 0], [0, 0, -0.4]), width_px=1279, height_px=724
    )
    aside = render(
        CHESS, CHESS.corners_m, optics, pose([0, 0, 0], [2, 0, 0.4]), width_px=1279, height_px=724
    )
    assert (behind == np.float32(BACKGROUND)).all()
    assert (aside == np.float32(BACKGROUND)).all()


def test_twelve_megapixels_take_seconds_not_minutes():
    optics, seen_from = camera(4096, 3072, 4755.8), pose([0.3, 0.2, 0.1], [-0.11, -0.06, 0.5])
    started = time.process_time()
    image = render(
        CHESS,
        CHESS.corners_m,
        optics,
        seen_from,
        width_px=4096,
        height_px=3072,
        blur=Blur(0.0032, 0.52, 0.5),
    )
    expose(image, Sensor(), exposure_s=0.01, rng=np.random.default_rng(0))
    assert time.process_time() - started < 10


def test_unknown_dictionary_is_named():
    board = Board("charuco", 4, 6, 0.03, 0.022, "DICT_9X9")
    with pytest.raises(ValueError, match="DICT_9X9"):
        render(
            board,
            board.corners_m,
            camera(64, 48, 90.0),
            pose([0, 0, 0], [0, 0, 1]),
            width_px=64,
            height_px=48,
        )


def test_a_wide_lens_shows_the_board_where_the_chain_says_to_its_rim():
    """Corners to 80 degrees off the axis: of a square's four sides the grey gives the place."""
    optics = camera(640, 480, 175.0, equidistant=1.0, k1=0.02, k2=-0.004, beta_px=176.0)
    points = CHESS.corners_m
    tilted = pose([0.0, np.radians(60.0), 0.0], [0.160, -0.075, 0.222])
    seen = project(optics[None], tilted[None], points)[0]
    in_camera = points @ tilted[:3, :3].T + tilted[:3, 3]
    angle = np.degrees(np.arctan2(np.hypot(in_camera[:, 0], in_camera[:, 1]), in_camera[:, 2]))
    fine = render(CHESS, points, optics, tilted, width_px=640, height_px=480)
    found = cv2.cornerSubPix(
        cv2.GaussianBlur(fine, (0, 0), 0.7),
        seen.astype(np.float32)[:, None].copy(),
        (4, 4),
        (-1, -1),
        (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-4),
    )[:, 0]
    off = np.linalg.norm(found - seen, axis=1)
    assert angle.max() > 78.0
    # squares at the rim are few pixels wide, and OpenCV's window holds their neighbours
    assert np.median(off) < 0.06
    assert np.mean(off < 0.2) > 0.7
