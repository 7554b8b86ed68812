"""A pose file, or a folder of them, as series of poses and of joint angles."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cell.errors import InputError
from cell.verbs.importing.layouts import read_file
from cell.verbs.importing.raw import RawPose, Role, Series

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".webp")
_POSE_SUFFIXES = (
    *(".csv", ".json", ".jsonl", ".yaml", ".yml", ".txt", ".tsv", ".dat", ".mod", ".src", ".ls"),
    *(".script", ".urscript", ".npz", ".npy", ".xml", ".log", ".samples", ".pose", ".tum", ".prg"),
)


def natural(path: Path) -> list[tuple[int, int | str]]:
    """Sort key that puts 2 before 10."""
    parts = re.split(r"(\d+)", path.name)
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts]


def visible(folder: Path) -> list[Path]:
    """The folder's files in natural order; hidden ones, as macOS leaves them, are none."""
    return sorted(
        (p for p in folder.iterdir() if not p.name.startswith(".") and p.is_file()), key=natural
    )


def read_series(path: Path) -> list[Series]:
    """All that a file, or a folder's pose files, hold.

    Raises
    ------
    InputError
        It cannot be read, or holds no pose.
    """
    found = _of_folder(path) if path.is_dir() else read_file(path)
    if not found:
        raise InputError(
            f"{path}: holds no pose. A pose is a row of 7 numbers (position, quaternion) or 6"
            " (position, rotation), or a 4x4 matrix; --poses takes the layouts of the"
            " documentation's how-to on importing"
        )
    return found


def _of_folder(folder: Path) -> list[Series]:
    """The series of all files; where each file has one pose, its name says whose."""
    files = [path for path in visible(folder) if path.suffix.lower() in _POSE_SUFFIXES]
    if not files:
        raise InputError(f"{folder}: has no pose file ({', '.join(_POSE_SUFFIXES)})")
    merged: dict[tuple[str, Role], Series] = {}
    for file in files:
        for series in read_file(file):
            if len(series.poses) == 1 and len(files) > 1:
                series = replace(series, poses=(_of_file(series.poses[0], file),))
            key = (series.key, series.role)
            before = merged.get(key)
            poses = (*before.poses, *series.poses) if before else series.poses
            merged[key] = replace(series, poses=poses)
    return list(merged.values())


def _of_file(pose: RawPose, file: Path) -> RawPose:
    """A pose that stands alone in its file belongs to the picture of the file's name."""
    numbers = re.findall(r"\d+", file.stem)
    return replace(pose, name=file.name, number=int(numbers[-1]) if numbers else None)


def read_poses(path: Path) -> list[RawPose]:
    """The flange's poses in a file or folder that holds no others.

    Raises
    ------
    InputError
        As `read_series`; or the file holds several kinds of poses, or poses of different widths.
    """
    return list(flange_series(path, read_series(path))[0].poses)


def flange_series(path: Path, found: Sequence[Series]) -> list[Series]:
    """The series that can be the flange's poses, the likeliest first.

    Raises
    ------
    InputError
        None of them can.
    """
    able = [series for series in found if series.role == "flange"]
    for series in able:
        check_widths(path, series)
    if not able:
        held = ", ".join(sorted({f"{s.layout} {s.key}".strip() for s in found}))
        joints = any(series.role == "joints" for series in found)
        more = " Say --robot MODEL, and the arm's kinematics make them poses." if joints else ""
        raise InputError(f"{path}: holds no pose of the flange, only {held}.{more}")
    longest = max(len(series.poses) for series in able)
    return sorted(
        (s for s in able if len(s.poses) > 0.5 * longest),
        key=lambda s: ("actual" not in s.key.lower(), "flange" not in s.key.lower(), len(s.key)),
    )


def check_widths(path: Path, series: Series) -> None:
    """Refuse poses of unlike widths in one series."""
    widths = sorted({len(pose.values) for pose in series.poses})
    if len(widths) > 1:
        raise InputError(f"{path}: holds poses of {' and '.join(map(str, widths))} numbers")
