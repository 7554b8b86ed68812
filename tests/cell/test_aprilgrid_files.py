"""AprilGrids in cell files, recordings, on the command line and in Kalibr's target files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from cell.cli.app import app
from cell.errors import InputError
from cell.storage.files.board_file import AprilGrid, Chessboard, board_file
from cell.storage.files.board_option import parse_board
from cell.storage.files.kalibr_target import kalibr_target

KALIBR = """\
target_type: 'aprilgrid' #gridtype
tagCols: 6               #number of apriltags
tagRows: 5               #number of apriltags
tagSize: 0.088           #size of apriltag, edge to edge [m]
tagSpacing: 0.3          #ratio of space between tags to tagSize
codeOffset: 0            #code offset for the first tag in the aprilboard
"""


def test_kalibrs_target_is_read_and_written(tmp_path: Path) -> None:
    path = tmp_path / "april.yaml"
    path.write_text(KALIBR)
    read = parse_board(str(path))
    assert isinstance(read, AprilGrid)
    assert (read.tags_x, read.tags_y, read.tag_m) == (6, 5, 0.088)
    assert read.gap_m == pytest.approx(0.0264)
    path.write_text(kalibr_target(read))
    assert parse_board(str(path)) == read
    assert YAML(typ="safe").load(path.read_text())["tagSpacing"] == pytest.approx(0.3)
    assert parse_board(str(path)) == read


def test_kalibrs_chessboard_is_counted_as_ours(tmp_path: Path) -> None:
    path = tmp_path / "chess.yaml"
    text = "target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\n"
    path.write_text(text + "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n")
    assert parse_board(str(path)) == Chessboard(type="chessboard", rows=7, cols=6, square_m=0.06)
    path.write_text(text + "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.05\n")
    with pytest.raises(InputError, match="only square ones are known"):
        parse_board(str(path))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("target_type: circlegrid\n", "target_type is 'circlegrid'; known are aprilgrid"),
        ("target_type: aprilgrid\ntagCols: six\n", "tagCols"),
        (KALIBR.replace("0.3 ", "-1 "), "greater than"),
        ("[", "april.yaml"),
    ],
)
def test_a_target_that_is_none_is_refused(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "april.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        parse_board(str(path))


def test_the_corners_stand_a_tag_and_a_gap_apart_in_turn() -> None:
    described = parse_board("aprilgrid:3x2x0.03x0.01")
    board = described.board()
    assert (board.rows, board.cols) == (4, 6)
    np.testing.assert_allclose(board.corners_m[:6, 0], [0, 0.03, 0.04, 0.07, 0.08, 0.11])
    np.testing.assert_allclose(board.corners_m[::6, 1], [0, 0.03, 0.04, 0.07])
    assert board.extent_m == pytest.approx((0.11, 0.07))
    assert board_file(board) == described
    with pytest.raises(InputError, match="has one tag"):
        parse_board("aprilgrid:1x1x0.03x0.01")


def test_cell_board_writes_kalibrs_file_and_names_what_draws_it(tmp_path: Path) -> None:
    out = tmp_path / "target.yaml"
    done = CliRunner().invoke(app, ["board", "aprilgrid:6x6x0.088x0.0264", "-o", str(out)])
    assert done.exit_code == 0
    assert parse_board(str(out)).board().corner_count == 144
    refused = CliRunner().invoke(
        app, ["board", "aprilgrid:6x6x0.088x0.0264", "-o", str(tmp_path / "b.pdf")]
    )
    assert isinstance(refused.exception, InputError)
    assert "--type apriltag --nx 6 --ny 6 --tsize 0.088 --tspace 0.3" in str(refused.exception)
