"""Corner lists of other finders, their order found from the pictures.

Finders number a board's corners from different ends: by rows or by columns, from any of four
corners. A picture's own detection says which, for it names corners by where the dark squares lie.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.views import Board, FloatArray
from cell.errors import InputError
from cell.storage.incoming import parse_json, read_text
from cell.storage.incoming.limits import JSON_BYTES
from cell.storage.recording import Corners

_SAME_PX = 3.0
"""Two finders put a corner within a tenth of a pixel of each other; squares are wider than this."""

_NAMES = ("filename", "file", "image", "name", "picture")
_X, _Y = ("x", "u", "u_px", "x_px", "px"), ("y", "v", "v_px", "y_px", "py")


def read_corner_list(path: Path, board: Board) -> dict[str, FloatArray]:
    """(M, 2) corners in the file's own order, by the picture's file name.

    Reads mrcal's and mrgingham's `corners.vnl`, CSV with a first row of names, JSON objects of
    lists by picture, and OpenCV's FileStorage with `image_points` (whose pictures stand in
    `image_list` or `images`); a missing corner is `-`, `nan` or null.

    Raises
    ------
    InputError
        It is none of these, or a picture has another number of corners than the board.
    """
    if path.suffix.lower() in (".yaml", ".yml", ".xml"):
        found = _of_file_storage(path)
    elif path.suffix.lower() == ".json":
        found = _of_json(path)
    else:
        found = _of_table(path)
    for name, corners in found.items():
        if len(corners) not in (board.corner_count, 1):
            raise InputError(
                f"{path}: {name} has {len(corners)} corners, and a board of {board.rows} x"
                f" {board.cols} has {board.corner_count}"
            )
    whole = {k: v for k, v in found.items() if len(v) == board.corner_count}
    if not whole:
        raise InputError(f"{path}: no picture has corners")
    return whole


def _of_table(path: Path) -> dict[str, FloatArray]:
    lines = [line for line in read_text(path, JSON_BYTES).splitlines() if line.strip()]
    head = next((k for k, line in enumerate(lines) if _columns(line) is not None), None)
    if head is None:
        raise InputError(
            f"{path}: has no first row of names, such as `# filename x y level` (mrcal) or"
            " image,x,y"
        )
    name_at, x_at, y_at = _columns(lines[head]) or (0, 1, 2)
    found: dict[str, list[list[float]]] = {}
    for number, line in enumerate(lines[head + 1 :], start=head + 2):
        if line.lstrip().startswith("#"):
            continue
        cells = _cells(line)
        try:
            point = [_number(cells[x_at]), _number(cells[y_at])]
            found.setdefault(Path(cells[name_at]).name, []).append(point)
        except (IndexError, ValueError):
            raise InputError(f"{path}:{number}: is no corner: {line.strip()[:60]}") from None
    return {name: np.array(points, dtype=np.float64) for name, points in found.items()}


def _cells(line: str) -> list[str]:
    text = line.strip().lstrip("#").strip()
    return [cell.strip().strip('"') for cell in (text.split(",") if "," in text else text.split())]


def _columns(line: str) -> tuple[int, int, int] | None:
    """Where a row of names has the picture, x and y; None where it is no such row."""
    names = [cell.lower() for cell in _cells(line)]
    places = [next((k for k, n in enumerate(names) if n in known), None)
              for known in (_NAMES, _X, _Y)]  # fmt: skip
    picture, x, y = places
    return None if picture is None or x is None or y is None else (picture, x, y)


def _number(text: str) -> float:
    return np.nan if text in ("-", "") else float(text)


def _of_json(path: Path) -> dict[str, FloatArray]:
    content = parse_json(read_text(path, JSON_BYTES), str(path))
    if not isinstance(content, Mapping):
        raise InputError(f'{path}: must be an object such as {{"img0.png": [[x, y], ...]}}')
    found = {}
    for name, points in content.items():
        try:
            rows = [p if p is not None else (np.nan, np.nan) for p in points]
            found[Path(str(name)).name] = np.array(rows, dtype=np.float64).reshape(-1, 2)
        except (TypeError, ValueError):
            raise InputError(f"{path}: {name}: must be a list of [x, y]") from None
    return found


def _of_file_storage(path: Path) -> dict[str, FloatArray]:
    import cv2  # one layout of several needs it

    read_text(path, JSON_BYTES)  # a clear error where it cannot be read
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        points = storage.getNode("image_points").mat()
        listed = next(
            (node for key in ("image_list", "images", "imagelist")
             if not (node := storage.getNode(key)).empty()), None
        )  # fmt: skip
    except (cv2.error, SystemError):
        points, listed = None, None
    if points is None or points.size == 0:
        raise InputError(f"{path}: has no `image_points` of OpenCV's FileStorage")
    each = np.asarray(points, dtype=np.float64).reshape(len(points), -1, 2)
    names = [] if listed is None else [listed.at(k).string() for k in range(listed.size())]
    if names and len(names) != len(each):
        raise InputError(f"{path}: lists {len(names)} pictures for {len(each)} sets of corners")
    # without names they are identified by their order, where there are as many as pictures
    keys = [Path(name).name for name in names] or [f"#{k}" for k in range(len(each))]
    return dict(zip(keys, each, strict=True))


def orders(board: Board) -> dict[str, NDArray[np.int64]]:
    """The eight orders of a grid: for each, where the corners stand in the file."""
    rows, cols = board.rows, board.cols
    by_rows = np.arange(rows * cols).reshape(rows, cols)
    by_columns = np.arange(rows * cols).reshape(cols, rows).T
    found = {}
    for name, grid in (("by rows", by_rows), ("by columns", by_columns)):
        for turned, step in (("", (1, 1)), (", rows from the other side", (-1, 1)),
                             (", columns from the other side", (1, -1)),
                             (", from the opposite corner", (-1, -1))):  # fmt: skip
            found[name + turned] = grid[:: step[0], :: step[1]].ravel()
    return found


def listed_corners(
    path: Path, pictures: Sequence[Path], board: Board, seen: Corners
) -> tuple[Corners, tuple[str, ...]]:
    """The list's corners by frame, named as the board is, and what was concluded of their order.

    Parameters
    ----------
    path, pictures:
        The list, and the pictures it is of, in the frames' order.
    board, seen:
        The corners that the pictures themselves show.

    Raises
    ------
    InputError
        Pictures and list do not go together.
    """
    by_name = read_corner_list(path, board)
    if all(name.startswith("#") for name in by_name) and len(by_name) == len(pictures):
        by_name = dict(zip([p.name for p in pictures], by_name.values(), strict=True))
    frames = {k: by_name[p.name] for k, p in enumerate(pictures) if p.name in by_name}
    if not frames:
        raise InputError(
            f"{path}: names none of the pictures; it has {', '.join(list(by_name)[:3])},"
            f" the pictures are {', '.join(p.name for p in pictures[:3])}"
        )
    chosen = {k: _order(listed, seen.px[k], board) for k, listed in frames.items() if k in seen.px}
    counted = Counter(name for name in chosen.values() if name is not None)
    if not counted:
        raise InputError(
            f"{path}: its corners are not those that the pictures show, in any order: are these"
            " the pictures it is of, at their full size, pixels counted from 0?"
        )
    usual = counted.most_common(1)[0][0]
    known = orders(board)
    px = {k: listed[known[chosen.get(k) or usual]] for k, listed in frames.items()}
    rejected = {k: "is not in the list of corners" for k in range(len(pictures)) if k not in px}
    stated = ", ".join(f"{name} ({count})" for name, count in counted.most_common())
    note = (
        f"corners of {len(px)} pictures come from {path.name}; by the pictures they stand {stated}"
    )
    return Corners(px=px, rejected=rejected), (note,)


def _order(listed: FloatArray, seen: FloatArray, board: Board) -> str | None:
    """The order in which the list's corners lie on those that were seen, or None."""
    off = {
        name: float(np.nanmedian(np.linalg.norm(listed[order] - seen, axis=1)))
        for name, order in orders(board).items()
        if np.isfinite(listed[order] - seen).any()
    }
    if not off:
        return None
    best = min(off, key=lambda name: off[name])
    return best if off[best] < _SAME_PX else None
