import re

import cv2
import numpy as np
import pytest
from board_rendering import photograph

from calib.detection import Rejected, detect
from calib.detection.charuco_fit import Guess, fit_charuco
from calib.detection.grid import Grid
from calib.detection.markers import on_board, place_by_markers
from calib.views import Board

BOARD = Board("charuco", 6, 4, 0.03, 0.021, "DICT_5X5_100")
OVERSAMPLING = 6


def photographed(blur_px=1.0, *, legacy=False, shift=(0.0, 0.0), first=0):
    """The board seen aslant, drawn by OpenCV and scaled down; and its true corners."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    numbers = np.arange(first, first + 17)
    layout = cv2.aruco.CharucoBoard((5, 7), 0.03, 0.021, dictionary, numbers)
    layout.setLegacyPattern(legacy)
    per_square = 70 * 4
    flat = layout.generateImage((5 * per_square, 7 * per_square), marginSize=0)
    # a sample of the large picture lies at (x + 0.5) / OVERSAMPLING - 0.5 of the small one
    corners = np.float32([[160, 60], [470, 95], [440, 440], [130, 400]]) + np.float32(shift)
    to = (corners + 0.5) * OVERSAMPLING - 0.5
    frame = np.float32([[0, 0], [5, 0], [5, 7], [0, 7]])
    H = cv2.getPerspectiveTransform(frame * per_square - 0.5, to)
    size = (640 * OVERSAMPLING, 480 * OVERSAMPLING)
    large = cv2.warpPerspective(flat, H, size, flags=cv2.INTER_LINEAR, borderValue=255)
    small = cv2.resize(large, (640, 480), interpolation=cv2.INTER_AREA).astype(float)
    image = cv2.GaussianBlur(40 + 0.65 * small, (0, 0), blur_px)
    place = BOARD.corners_m[:, :2] / BOARD.square_m + 1
    truth = cv2.perspectiveTransform(place[None] * per_square - 0.5, H.astype(float))[0]
    return image, (truth + 0.5) / OVERSAMPLING - 0.5


@pytest.mark.parametrize("blur_px", [0.8, 1.5])
def test_corners_beside_markers_are_as_good_as_any(blur_px):
    image, truth = photographed(blur_px)
    found = detect(photograph(image), BOARD)
    assert found, found.reason
    assert found.upside_down_known
    error = found.corners_px - truth
    assert np.sqrt(np.square(error).mean()) < 0.025
    assert np.abs(error.mean(axis=0)).max() < 0.01
    assert found.frame_blur_px == pytest.approx(blur_px, rel=0.15)


def test_blur_that_markers_cannot_be_read_through_costs_neither_the_board_nor_its_corners():
    image, truth = photographed(3.5)
    picture = photograph(image)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    _, read, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)
    assert read is None or len(read) < 2
    found = detect(picture, BOARD)
    assert found, found.reason
    error = found.corners_px - truth
    assert np.sqrt(np.square(error).mean()) < 0.05
    assert np.abs(error.mean(axis=0)).max() < 0.02
    assert found.frame_blur_px == pytest.approx(3.5, rel=0.1)


def test_markers_name_the_corners_of_a_turned_and_shifted_grid():
    image, truth = photographed(2.0)
    corners = truth.reshape(6, 4, 2)
    whole = Grid(corners, first_dark=True)
    picture = photograph(image).astype(np.float32)
    part = Grid(corners[1:, 1:], first_dark=True).turned(1)
    for grid, place in ((whole, (0, 0, 0)), (whole.turned(1), (3, 0, 0)), (part, (3, -1, -1))):
        found = place_by_markers(picture, grid, BOARD)
        assert found is not None
        assert found.where == place
        named = on_board(grid, found, BOARD).corners_px
        known = np.isfinite(named)
        np.testing.assert_allclose(named[known], corners[known])
    assert place_by_markers(np.full_like(picture, 90.0), whole, BOARD) is None


def test_corners_off_by_a_whole_square_are_turned_down():
    image, truth = photographed(1.0)
    aside = np.roll(truth.reshape(6, 4, 2), (1, 1), axis=(0, 1))
    aside[0], aside[:, 0] = 2 * aside[1] - aside[2], 2 * aside[:, 1] - aside[:, 2]
    seen = fit_charuco(photograph(image).astype(np.float32), Guess(aside), BOARD)
    assert isinstance(seen, Rejected)


def test_unseen_corners_are_nan_and_the_others_keep_their_names():
    image, truth = photographed(1.0)
    image[250:] = 90.0
    found = detect(photograph(image), BOARD)
    assert found
    seen = np.isfinite(found.corners_px[:, 0])
    assert not seen[truth[:, 1] > 250].any()
    assert seen[truth[:, 1] < 230].all()
    assert np.abs(found.corners_px[seen] - truth[seen]).max() < 0.15
    assert np.isnan(found.sigma_px[~seen]).all()


def test_a_picture_without_its_markers_is_rejected():
    rejected = detect(np.full((480, 640), 128, np.uint8), BOARD)
    assert isinstance(rejected, Rejected)
    assert "markers" in rejected.reason


def test_a_board_described_without_markers_is_rejected():
    image, _ = photographed()
    rejected = detect(photograph(image), Board("charuco", 6, 4, 0.03))
    assert isinstance(rejected, Rejected)
    assert "dictionary" in rejected.reason


@pytest.mark.parametrize(
    ("described", "message"),
    [
        ((4, 4), r"markers 0 to 16 are in sight, and the described board of 5 x 5 squares .* more"),
        ((6, 3), "has them in other places: it has other numbers of squares"),
        ((4, 6), "has them in other places: it has other numbers of squares"),
        ((8, 6), "has them in other places: it has other numbers of squares"),
    ],
)
def test_a_board_other_than_described_is_refused_with_what_was_seen(described, message):
    image, _ = photographed(1.0)
    rows, cols = described
    found = detect(photograph(image), Board("charuco", rows, cols, 0.03, 0.021, "DICT_5X5_100"))
    assert isinstance(found, Rejected)
    assert re.search(message, found.reason), found.reason


def test_a_board_of_fewer_rows_than_described_lacks_them():
    image, truth = photographed(1.0)
    found = detect(photograph(image), Board("charuco", 8, 4, 0.03, 0.021, "DICT_5X5_100"))
    corners = found.corners_px.reshape(8, 4, 2)
    assert corners[:6].reshape(-1, 2) == pytest.approx(truth, abs=0.2)
    assert np.isnan(corners[6:]).all()


def test_a_board_whose_markers_are_numbered_from_another_one_is_refused():
    image, _ = photographed(1.0, first=30)
    found = detect(photograph(image), BOARD)
    assert isinstance(found, Rejected)
    assert "markers 30 to 46 are in sight" in found.reason
    assert "has 0 to 16: its first marker is another one" in found.reason
