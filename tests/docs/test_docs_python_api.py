"""docs/python-api.md runs as it stands, and prints what it says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import calib
from calib import Board, Views
from tests.docs.pages import ROOT, assert_same, blocks, commands, run_command, run_python

PAGE = ROOT / "docs" / "python-api.md"


def test_the_page_prints_what_it_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    printed, compared = "", 0
    for block in blocks(PAGE):
        if block.language == "python":
            printed = run_python(block.code, block.line, PAGE, names)
        elif block.language == "console":
            for words in commands(block):
                run_command(words)
        elif block.language == "text":
            assert_same(printed, block.code)
            compared += 1
    assert compared == 8
    assert len(repr(names["found"])) < 500
    assert "<table>" in names["found"]._repr_html_()
    assert names["diagnosis"].plot().axes


def test_every_name_of_the_api_is_there_and_documented() -> None:
    for name in calib.__all__:
        assert getattr(calib, name).__doc__, name
    assert set(calib.__all__) <= set(dir(calib))
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        calib.calibrat  # noqa: B018


def test_importing_calib_loads_nothing_heavy() -> None:
    import subprocess
    import sys

    code = "import sys, calib; print({'numpy', 'scipy', 'numba', 'cv2'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize(
    ("shape", "logged", "words"),
    [
        ((5, 60, 2), {}, r"\(5, 60, 2\); a board of 7 rows and 10 columns needs \(N, 70, 2\)"),
        ((5, 10, 7, 2), {}, r"needs \(N, 70, 2\) or \(N, 7, 10, 2\)"),
        ((5, 70, 2), {"base_from_flange": (4, 4, 4)}, "base_from_flange has the shape"),
        ((5, 70, 2), {"t_s": (5, 1)}, "t_s has the shape"),
        ((5, 70, 2), {"joints": (5, 6)}, "joints is not a column; known are frame, corners_px"),
    ],
)
def test_arrays_of_the_wrong_shape_are_reported(
    shape: tuple[int, ...], logged: dict[str, tuple[int, ...]], words: str
) -> None:
    import numpy as np

    board = Board("chessboard", rows=7, cols=10, square_m=0.025)
    columns: dict[str, Any] = {name: np.zeros(of) for name, of in logged.items()}
    with pytest.raises(ValueError, match=words):
        Views.from_corners(board, np.zeros(shape), image_size_px=(640, 480), **columns)
