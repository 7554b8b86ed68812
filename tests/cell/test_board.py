"""`cell board`: what is drawn is the board that the detector finds, at scale."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from calib.detection import Detection, detect
from calib.views import Board
from cell.errors import InputError
from cell.verbs.board.pattern import dark
from cell.verbs.board.sheet import draw_board, sheet
from tests.cell.test_cli import ROOT, Cell
from tests.cell.test_cli import cell as cell  # a fixture

CHESS = Board("chessboard", 7, 10, 0.025)
CHARUCO = Board("charuco", 6, 4, 0.036, 0.018, "DICT_6X6_250")


def picture(rectangles: object, width_mm: float, height_mm: float, scale: int) -> np.ndarray:
    """Pixels, `scale` to the millimetre, each edge averaged over the pixel that it crosses."""
    fine = 2 * scale
    image = np.full((round(height_mm * fine), round(width_mm * fine)), 225.0, dtype=np.float32)
    for x, y, wide, high in rectangles:  # type: ignore[attr-defined]
        low, right = (round(v * fine) for v in (x, x + wide))
        top, end = (round(v * fine) for v in (y, y + high))
        image[top:end, low:right] = 30.0
    return image.reshape(image.shape[0] // 2, 2, image.shape[1] // 2, 2).mean((1, 3)).astype("u1")


@pytest.mark.parametrize("board", [CHESS, CHARUCO], ids=["chessboard", "charuco"])
def test_the_detector_finds_the_board_where_it_was_drawn(board: Board) -> None:
    page = sheet(board)
    found = detect(picture(page.rectangles, page.width_mm, page.height_mm, 3), board)
    assert isinstance(found, Detection), found.reason
    left, top = (min(r[k] for r in page.rectangles) for k in (0, 1))
    side = 1e3 * board.square_m
    rows, cols = np.divmod(np.arange(board.rows * board.cols), board.cols)
    drawn = np.stack([left + (cols + 1) * side, top + (rows + 1) * side], axis=1) * 3 - 0.5
    assert found.corners_px.reshape(-1, 2) == pytest.approx(drawn, abs=0.2)


def test_row_0_is_the_side_whose_two_corner_squares_are_dark() -> None:
    squares = {(round(x), round(y)) for x, y, *_ in dark(CHESS)}
    assert {(0, 0), (250, 0)} <= squares
    assert not {(0, 175), (250, 175)} & squares


@pytest.mark.parametrize("suffix", [".pdf", ".svg"])
def test_page_and_ruler_are_at_scale(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"board{suffix}"
    assert draw_board(CHESS, path, "a3") == (420.0, 297.0)
    text = path.read_text(encoding="ascii")
    if suffix == ".svg":
        assert 'width="420.0000mm" height="297.0000mm" viewBox="0 0 420.0000 297.0000"' in text
        ruler = re.search(r'<path d="M([\d.]+) [\d.]+L([\d.]+)', text)
        unit_mm = 1.0
    else:
        assert "/MediaBox [0 0 1190.5512 841.8898]" in text
        assert "/PrintScaling /None" in text
        ruler = re.search(r"^([\d.]+) [\d.]+ m ([\d.]+)", text, re.MULTILINE)
        scale = re.search(r"^([\d.]+) 0 0 -[\d.]+ 0 [\d.]+ cm", text, re.MULTILINE)
        assert scale is not None
        unit_mm = float(scale[1]) * 25.4 / 72
    assert ruler is not None
    assert (float(ruler[2]) - float(ruler[1])) * unit_mm == pytest.approx(100.0, abs=1e-4)
    assert "square_m: 0.025" in text


def test_every_object_of_the_pdf_begins_where_its_table_says(tmp_path: Path) -> None:
    draw_board(CHARUCO, tmp_path / "b.pdf")
    data = (tmp_path / "b.pdf").read_bytes()
    start = int(data.split(b"startxref\n")[1].split()[0])
    assert data[start:].startswith(b"xref")
    begins = [int(row.split()[0]) for row in data[start:].split(b"\n")[3:9]]
    assert [data[begin:].split(b" ")[0] for begin in begins] == [b"%d" % k for k in range(1, 7)]


def test_a_board_has_its_white_edge_and_its_paper(tmp_path: Path) -> None:
    page = sheet(CHESS)
    assert min(r[0] for r in page.rectangles) >= 25.0
    assert max(x + w for x, _, w, _ in page.rectangles) <= page.width_mm - 25.0
    with pytest.raises(InputError, match=r"too small: the board .* needs 325 x 276 mm"):
        draw_board(CHESS, tmp_path / "b.pdf", "a4")
    with pytest.raises(InputError, match=r"must end with \.pdf or \.svg"):
        draw_board(CHESS, tmp_path / "b.png")
    many = Board("charuco", 29, 29, 0.01, 0.005, "DICT_4X4_50")
    with pytest.raises(InputError, match="needs 450 markers, and DICT_4X4_50 has 50"):
        draw_board(many, tmp_path / "b.pdf")
    assert not list(tmp_path.iterdir())


def test_the_verb_says_what_goes_into_the_cell_file(cell: Cell, tmp_path: Path) -> None:
    result = cell("board", "7x10x0.025", "-o", tmp_path / "b.pdf")
    assert result.status == 0, result.err
    assert "board: {type: chessboard, rows: 7, cols: 10, square_m: 0.025}" in result.out
    assert "11 squares along a row 275.0 mm, 8 along a column 200.0 mm" in result.out
    of_cell = cell("board", ROOT / "configs" / "ur3-robotiq.cell.yaml", "-o", tmp_path / "c.pdf")
    assert (of_cell.status, of_cell.out) == (0, result.out.replace("b.pdf", "c.pdf"))
    neither = tmp_path / "neither.yaml"
    neither.write_text("name: bench\n")
    refused = cell("board", neither, "-o", tmp_path / "d.pdf")
    assert refused.status == 2
    assert "neither `board`" in refused.err
    assert cell("board", "7x10", "-o", tmp_path / "b.pdf").status == 2
    assert cell("board", "7x10x0.025", "-o", tmp_path / "no" / "b.pdf").status == 2
