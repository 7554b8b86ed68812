"""A coded board with fewer squares than described is noticed, one that is seen in part is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.calibration.cautions import cautions
from calib.calibration.unseen_edge import unseen_edge
from calib.chain.projection import project
from calib.views import Board, Views
from tests.paper.scene import mixed_scene

SCENE = mixed_scene(4, 8)
GRIDS = {
    "charuco": Board("charuco", 8, 6, 0.02, 0.014, "DICT_5X5_100"),
    "aprilgrid": Board("aprilgrid", 8, 6, 0.02, None, "DICT_APRILTAG_36h11", gap_m=0.006),
}


def pictured(board: Board, *, zoom: float = 1.0, count: int = 12) -> Views:
    """Its corners as a camera sees them; NaN outside the picture."""
    optics = np.tile(SCENE.optics[0], (count, 1))
    corners = project(optics, SCENE.camera_from_board[:count], board.corners_m)
    views = SCENE.views.take(np.arange(count))
    middle = 0.5 * np.array([views.width_px, views.height_px])
    corners = middle + zoom * (corners - corners.mean(axis=1, keepdims=True))
    outside = ((corners < 0) | (corners > 2 * middle)).any(axis=2)
    corners[outside] = np.nan
    return replace(views, board=board, corners_px=corners, corner_sigma_px=corners[..., 0])


def without(views: Views, rows: slice, cols: slice) -> Views:
    """The same where only these rows and columns of the board exist."""
    grid = views.corners_px.reshape(-1, views.board.rows, views.board.cols, 2)
    there = np.full_like(grid, np.nan)
    there[:, rows, cols] = grid[:, rows, cols]
    return replace(views, corners_px=there.reshape(views.corners_px.shape))


ALL = slice(None)


@pytest.mark.parametrize("kind", GRIDS)
@pytest.mark.parametrize(
    ("rows", "cols", "named"),
    [
        (slice(0, 6), ALL, ["rows 6 to 7"]),
        (slice(0, 7), ALL, ["row 7"]),
        (slice(2, 8), ALL, ["rows 0 to 1"]),
        (ALL, slice(0, 4), ["columns 4 to 5"]),
        (slice(0, 6), slice(1, 6), ["rows 6 to 7", "column 0"]),
    ],
)
def test_edges_that_no_picture_shows_are_named(
    kind: str, rows: slice, cols: slice, named: list[str]
) -> None:
    views = without(pictured(GRIDS[kind]), rows, cols)
    found = cautions(views, {}, None, None, (), None)
    assert [c.where.removeprefix("board; ").split(" of")[0] for c in found] == named
    assert all("of 8 x 6 corners" in c.what and "of 12 reach beyond" in c.what for c in found)


def test_a_whole_board_and_one_that_is_seen_in_part_pass_without_a_word() -> None:
    board = GRIDS["charuco"]
    assert not list(unseen_edge(pictured(board)))
    assert not list(unseen_edge(pictured(board, zoom=4.0)))
    large = pictured(board, zoom=10.0)
    rows = large.seen.any(axis=0).reshape(8, 6).any(axis=1)
    assert 2 <= rows.sum() < 8, "some rows are in no picture, but outside it"
    assert not list(unseen_edge(large))


def test_an_edge_hidden_in_some_pictures_is_no_smaller_board() -> None:
    views = pictured(GRIDS["charuco"])
    hidden = without(views, slice(0, 6), ALL).corners_px
    hidden[5] = views.corners_px[5]
    assert not list(unseen_edge(replace(views, corners_px=hidden)))
    few = without(views, slice(0, 6), ALL).take(np.arange(2))
    assert not list(unseen_edge(few))


def test_a_chessboard_is_found_whole_or_not_at_all() -> None:
    views = replace(pictured(GRIDS["charuco"]), board=Board("chessboard", 8, 6, 0.02))
    assert not list(unseen_edge(without(views, slice(0, 6), ALL)))
