"""AprilGrids: every corner under its own name, to a hundredth of a pixel."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.detection import Detection, detect
from calib.detection.aprilgrid import tag_corners
from calib.views import Board, FloatArray
from sim.render import render

BOARD = Board("aprilgrid", 8, 10, 0.03, dictionary="DICT_APRILTAG_36h11", gap_m=0.009)
OPTICS = optics_row(alpha_px=900, beta_px=900, u0_px=400, v0_px=300, k1=-0.1, height_px=600)


def _seen(
    turn_deg: tuple[float, float, float],
    *,
    aside_m: tuple[float, float] = (0.0, 0.0),
    blur_px: float = 0.8,
    noise: float = 2.0,
    board: Board = BOARD,
) -> tuple[NDArray[np.uint8], FloatArray]:
    """A picture of the board, and where the chain has its corners."""
    turn = Rotation.from_euler("xyz", turn_deg, True)
    middle = board.corners_m.mean(axis=0)
    pose = RigidTransform.from_components(np.array([*aside_m, 0.34]) - turn.apply(middle), turn)
    M = pose.as_matrix()
    # blur must not meet the picture's rim
    wide = OPTICS.copy()
    wide[[3, 4]] += 16
    clear = render(board, board.corners_m, wide, M, width_px=832, height_px=632)
    image = 255 * cv2.GaussianBlur(clear, (0, 0), blur_px)[16:-16, 16:-16]
    noisy = image + np.random.default_rng(1).normal(0, noise, image.shape)
    truth = project(OPTICS[None], M[None], board.corners_m)[0]
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8), truth


def _found(image: NDArray[Any], board: Board = BOARD) -> Detection:
    found = detect(image, board)
    assert isinstance(found, Detection), found
    return found


@pytest.mark.parametrize(
    ("turn_deg", "blur_px"),
    [((5, -8, 3), 0.5), ((25, 10, 100), 1.2), ((-20, -15, 185), 0.5), ((12, 28, -80), 1.2)],
)
def test_corners_to_a_hundredth_of_a_pixel(
    turn_deg: tuple[float, float, float], blur_px: float
) -> None:
    """As a chessboard's; no half pixel between truth, picture and corner, in no direction."""
    image, truth = _seen(turn_deg, blur_px=blur_px)
    found = _found(image)
    off = found.corners_px - truth
    assert np.isfinite(off).all()
    assert np.sqrt(np.square(off).mean()) < 0.01
    assert np.abs(off).max() < 0.04
    assert np.abs(off.mean(axis=0)).max() < 0.004
    assert 0.4 < np.sqrt(np.square(off).mean()) / np.sqrt(np.square(found.sigma_px).mean()) < 3.5


def test_the_names_follow_from_the_tags_numbers() -> None:
    """With tag 0 at the bottom left (Kalibr) row 0 is above, and its first corner tag 15's."""
    assert np.array_equal(tag_corners(np.array([15]), BOARD)[0], [[0, 0], [1, 0], [1, 1], [0, 1]])
    image, truth = _seen((0, 0, 0))
    found = _found(image)
    assert np.abs(found.corners_px - truth).max() < 0.1
    corners = found.corners_px.reshape(8, 10, 2)
    assert (np.diff(corners[..., 0], axis=1) > 0).all()
    assert (np.diff(corners[..., 1], axis=0) > 0).all()
    assert found.upside_down_known


@pytest.mark.parametrize("quarters", [1, 2])
def test_tags_turned_in_their_places_give_the_same_corners(quarters: int) -> None:
    """Kalibr prints tags half a turn away from OpenCV's drawing; the names must not follow."""
    image, truth = _seen((0, 0, 0))
    turned = image.copy()
    x, y = truth.reshape(8, 10, 2)[..., 0], truth.reshape(8, 10, 2)[..., 1]
    for row in range(0, 8, 2):
        for col in range(0, 10, 2):
            left, top = round(x[row, col]) + 9, round(y[row, col]) + 9
            side = round(x[row, col + 1]) - 9 - left
            part = image[top : top + side, left : left + side]
            turned[top : top + side, left : left + side] = np.rot90(part, quarters)
    found = _found(turned)
    assert np.sqrt(np.nanmean(np.square(found.corners_px - truth))) < 0.02


def test_a_part_of_the_board_is_enough() -> None:
    image, truth = _seen((10, 20, 30), aside_m=(0.13, 0.08))
    found = _found(image)
    seen = np.isfinite(found.corners_px).all(axis=1)
    inside = ((truth > 8) & (truth < np.array([800, 600]) - 9)).all(axis=1)
    outside = ((truth < 0) | (truth > np.array([799, 599]))).any(axis=1)
    assert 20 < inside.sum() < 70
    assert seen[inside].mean() > 0.95
    assert not seen[outside].any()
    assert np.abs(found.corners_px - truth)[seen].max() < 0.1


def test_a_covered_tag_hides_its_corners_only() -> None:
    image, truth = _seen((0, 0, 0))
    corners = np.rint(truth.reshape(8, 10, 2)).astype(int)
    low, high = corners[2, 4] - 6, corners[3, 5] + 7
    image[low[1] : high[1], low[0] : high[0]] = 120
    found = _found(image)
    hidden = ~np.isfinite(found.corners_px.reshape(8, 10, 2)).all(axis=2)
    assert hidden[2:4, 4:6].all()
    # those next to it see the cover, all others do not
    hidden[1:5, 3:7] = False
    assert not hidden.any()


@pytest.mark.parametrize(
    ("board", "words"),
    [
        (Board("aprilgrid", 8, 8, 0.03, dictionary="DICT_APRILTAG_36h11", gap_m=0.009), "tags_x"),
        (Board("aprilgrid", 2, 2, 0.03, dictionary="DICT_APRILTAG_36h11", gap_m=0.009), "fewer"),
    ],
)
def test_another_board_is_refused(board: Board, words: str) -> None:
    found = detect(_seen((0, 0, 0))[0], board)
    assert not found
    assert words in found.reason


def test_a_mirrored_picture_and_an_empty_one_are_refused() -> None:
    image, _ = _seen((0, 0, 0))
    for picture in (np.ascontiguousarray(image[:, ::-1]), np.full_like(image, 90)):
        found = detect(picture, BOARD)
        assert not found
