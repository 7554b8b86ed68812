"""The pictures and pose files of a folder that another tool left."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from cell.errors import InputError
from cell.storage.incoming.pictures import picture_size_px
from cell.verbs.importing.pose_files import IMAGE_SUFFIXES, visible

_DEPTH = re.compile(r"depth|disparity|(?:^|[_-])(?:ir|infra\w*)(?:[_-]|\d|$)", re.IGNORECASE)
_TABLES = (".csv", ".json", ".yaml", ".yml", ".txt", ".npz", ".samples")


def pictures_in(folder: Path) -> tuple[list[Path], tuple[str, ...]]:
    """The pictures in natural order, and what was left out, to be reported.

    Hidden files are none, and depth or infrared pictures that stand beside colour ones are left
    out.

    Raises
    ------
    InputError
        There is none.
    """
    found = [path for path in visible(folder) if path.suffix.lower() in IMAGE_SUFFIXES]
    if not found:
        inner = [p.name for p in sorted(folder.iterdir()) if p.is_dir() and _has_pictures(p)]
        hint = f"; its folder {inner[0]} has: name that one" if inner else ""
        raise InputError(f"{folder}: has no pictures ({', '.join(IMAGE_SUFFIXES)}){hint}")
    colour = [path for path in found if not _DEPTH.search(path.stem)]
    depth = len(found) - len(colour)
    if not colour or not depth:
        return found, ()
    return colour, (f"{depth} depth or infrared pictures beside the others are left out",)


def _has_pictures(folder: Path) -> bool:
    return any(path.suffix.lower() in IMAGE_SUFFIXES for path in visible(folder))


def pose_files_beside(folder: Path) -> list[str]:
    """Names of files in a folder of pictures that may hold poses."""
    return [path.name for path in visible(folder) if path.suffix.lower() in _TABLES]


def common_size_px(pictures: Sequence[Path]) -> tuple[tuple[int, int], tuple[str, ...]]:
    """(width, height) of most pictures, and a word about those of another size.

    Raises
    ------
    InputError
        None of them is an image.
    """
    sizes = Counter(size for picture in pictures if (size := _size_of(picture)) is not None)
    if not sizes:
        raise InputError(f"{pictures[0].parent}: none of the {len(pictures)} pictures is an image")
    (size, _), *others = sizes.most_common()
    if not others:
        return size, ()
    listed = ", ".join(f"{count} of {width}x{height}" for (width, height), count in others)
    return size, (
        f"the camera's pictures have {size[0]}x{size[1]} pixels; {listed} are left out:"
        " another camera, binning or region, or scaled pictures",
    )


def _size_of(picture: Path) -> tuple[int, int] | None:
    try:
        return picture_size_px(picture)
    except InputError:
        return None  # reported, with its reason, as a frame without corners
