"""Corner lists of other finders become a recording's corners, whichever end they begin at."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.detection import Detection, detect
from calib.views import Board, FloatArray
from cell.errors import InputError
from cell.storage.recording import read_recording
from cell.verbs.importing.corner_lists import orders
from cell.verbs.importing.described import Described
from cell.verbs.importing.importer import import_source
from tests.cell.test_import import picture

BOARD = Board("chessboard", 4, 5, 0.025)
STATED = {"type": "chessboard", "rows": 4, "cols": 5, "square_m": 0.025}
NAMES = ("left 1.png", "left 2.png")
Corner = dict[str, FloatArray]


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two pictures, the second moved by some pixels, and one in which nothing was found."""
    folder = tmp_path_factory.mktemp("photos")
    image = picture()
    for name, shift in zip((*NAMES, "left 3.png"), (0, 5, 9), strict=True):
        cv2.imwrite(str(folder / name), np.roll(image, shift, axis=1))
    return folder


@pytest.fixture(scope="module")
def truth() -> Corner:
    found = detect(picture(), BOARD)
    assert isinstance(found, Detection)
    return {n: found.corners_px + np.array([by, 0.0]) for n, by in zip(NAMES, (0, 5), strict=True)}


def vnl(path: Path, lists: Corner) -> None:
    """As mrgingham writes it for mrcal: a picture without corners is one row."""
    rows = ["# generated", "# filename x y level"]
    for name, points in lists.items():
        rows += [f"{name.replace(' ', '_')} {x} {y} 0" if np.isfinite(x) else
                 f"{name.replace(' ', '_')} - - -" for x, y in points.tolist()]  # fmt: skip
    path.write_text("\n".join([*rows, "left_3.png - - -"]) + "\n")


def csv(path: Path, lists: Corner) -> None:
    rows = [f"{x},{y},/data/{name}" for name, points in lists.items() for x, y in points.tolist()]
    path.write_text("u_px,v_px,image\n" + "\n".join(rows) + "\n")


def listed_json(path: Path, lists: Corner) -> None:
    points = {name: [None if np.isnan(p).any() else p.tolist() for p in v]
              for name, v in lists.items()}  # fmt: skip
    path.write_text(json.dumps(points))


def file_storage(path: Path, lists: Corner) -> None:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_list", list(lists))
    storage.write("image_points", np.stack(list(lists.values())).astype(np.float32))
    storage.release()


WRITERS: dict[str, Callable[[Path, Corner], None]] = {
    "corners.vnl": vnl, "corners.csv": csv, "corners.json": listed_json, "points.yml": file_storage
}  # fmt: skip


@pytest.mark.parametrize(
    ("file", "order"),
    [
        ("corners.vnl", "by rows"),
        ("corners.csv", "by columns, from the opposite corner"),
        ("corners.json", "by rows, from the opposite corner"),
        ("points.yml", "by columns, rows from the other side"),
    ],
)
def test_a_list_is_named_as_the_board_is(
    photos: Path, truth: Corner, tmp_path: Path, file: str, order: str
) -> None:
    written = {}
    for name, corners in truth.items():
        written[name] = np.empty_like(corners)
        written[name][orders(BOARD)[order]] = corners + 0.05
    lost = file != "points.yml"
    if lost:
        written[NAMES[1]][3] = np.nan
    source = photos
    if file == "corners.vnl":  # names in such a table have no blanks
        source = tmp_path / "photos"
        source.mkdir()
        for path in photos.iterdir():
            (source / path.name.replace(" ", "_")).write_bytes(path.read_bytes())
    WRITERS[file](tmp_path / file, written)
    described = Described(board=STATED, corners=tmp_path / file)
    imported = import_source(source, tmp_path / "r", described)
    assert (imported.frames, imported.with_corners) == (3, 2)
    assert f"by the pictures they stand {order} (2)" in " ".join(imported.guessed)
    assert "not in the list" in imported.rejected[2]
    recording = read_recording(tmp_path / "r")
    found = recording.detections().px
    for frame, corners in enumerate(truth.values()):
        off = found[frame] - corners - 0.05
        assert np.isnan(off).any(axis=1).sum() == (frame == 1 and lost)
        assert np.nanmax(np.abs(off)) < 1e-3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a b c\n1 2 3\n", "has no first row of names"),
        (
            "# filename x y\nleft_1.png 1 2\nleft_1.png 1 2\n",
            "has 2 corners, and a board of 4 x 5",
        ),
        ("# filename x y\nleft_1.png one 2\n", ":2: is no corner"),
        ("image,x,y\n" + "other.png,1,2\n" * 20, "names none of the pictures"),
        ("image,x,y\n" + "left 1.png,1,2\n" * 20, "are not those that the pictures show"),
    ],
)
def test_a_list_that_cannot_be_is_refused(
    photos: Path, tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "c.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        import_source(photos, tmp_path / "r", Described(board=STATED, corners=tmp_path / "c.txt"))
