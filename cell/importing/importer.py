"""`cell import`: another tool's images and poses, or a recording, as a checked new recording."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from calib.views import Mount
from cell.calibrate import Progress, detect_corners
from cell.errors import BadAnswer, InputError
from cell.importing import RotationName, Unit
from cell.importing.conventions import Convention, conclude
from cell.importing.pose_files import RawPose, natural, number_in, read_poses
from cell.recording import (
    FrameRecord,
    Header,
    PoseRecord,
    Recording,
    RecordingWriter,
    read_recording,
    write_corners,
)
from cell.recording.corners import FILE_NAME as DETECTIONS

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".webp")


@dataclass(frozen=True)
class Described:
    """What the user says of images and poses.

    Attributes
    ----------
    board:
        In the words of `recording.yaml`.
    poses:
        File or folder of the poses; None: pictures alone.
    rotation, unit, inverted:
        How poses are written; `inverted`: they are flange_from_base.
    mount, robot, name:
        For `recording.yaml`.
    """

    board: dict[str, Any] | None = None
    poses: Path | None = None
    rotation: RotationName | None = None
    unit: Unit | None = None
    inverted: bool = False
    mount: Mount = "eye_in_hand"
    robot: str | None = None
    name: str | None = None


@dataclass(frozen=True)
class Imported:
    """What came of an import.

    Attributes
    ----------
    folder, frames, with_corners:
        The recording, its frames, and in how many of them the board was found.
    guessed:
        What was concluded and not said.
    rejected:
        Frame number to the reason why it has no corners.
    """

    folder: Path
    frames: int
    with_corners: int
    guessed: tuple[str, ...]
    rejected: dict[int, str]


def import_source(
    source: Path, folder: Path, described: Described, progress: Progress | None = None
) -> Imported:
    """Make a recording in `folder` of `source`.

    Raises
    ------
    InputError
        The source cannot be used, or is not described well enough.
    BadAnswer
        The board was found in no picture.
    """
    if (source / "recording.yaml").exists():
        guessed = _copy_recording(read_recording(source), folder)
    elif source.is_dir():
        guessed = _import_pictures(source, folder, described)
    else:
        raise InputError(f"{source}: is no folder of pictures and no recording")
    return _find_corners(read_recording(folder), guessed, progress)


def _copy_recording(recording: Recording, folder: Path) -> tuple[str, ...]:
    """Copy a recording, checked: pictures as they are, every line whole."""
    with RecordingWriter.create(folder, recording.header) as writer:
        for frame in recording.frames:
            if frame.image is not None and (recording.path / frame.image).exists():
                (folder / frame.image).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(recording.path / frame.image, folder / frame.image)
            writer.append(frame)
    if recording.has_detections:
        write_corners(folder / DETECTIONS, recording.detections(), recording.board)
    return ()


def _import_pictures(source: Path, folder: Path, described: Described) -> tuple[str, ...]:
    pictures = sorted(
        (path for path in source.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES), key=natural
    )
    if not pictures:
        raise InputError(f"{source}: has no pictures ({', '.join(IMAGE_SUFFIXES)})")
    if described.board is None:
        raise InputError(
            "the board is not said: give --board ROWSxCOLSxSQUARE in inner corners and metres, such"
            " as --board 6x9x0.025"
        )
    poses = [] if described.poses is None else read_poses(described.poses)
    convention = conclude(poses, described.rotation, described.unit) if poses else None
    pairs = _pairs(pictures, poses)
    header = _header(source, pictures, described, convention)
    with RecordingWriter.create(folder, header) as writer:
        for frame, (picture, pose) in enumerate(pairs):
            name = f"images/{frame:05d}{picture.suffix.lower()}"
            shutil.copy2(picture, folder / name)
            writer.append(_frame(frame, name, picture, pose, convention, described.inverted))
    return () if convention is None else convention.guessed


def _pairs(pictures: Sequence[Path], poses: Sequence[RawPose]) -> list[tuple[Path, RawPose | None]]:
    """Pictures with their poses: by number where both tell one, else one by one."""
    if not poses:
        return [(picture, None) for picture in pictures]
    by_number = {pose.number: pose for pose in poses}
    if None not in by_number and len(by_number) == len(poses):
        return [(picture, by_number.get(number_in(picture.stem))) for picture in pictures]
    if len(poses) != len(pictures):
        raise InputError(
            f"{len(pictures)} pictures and {len(poses)} poses, and nothing tells which belong"
            " together. Remove the ones without a partner, or number both."
        )
    return list(zip(pictures, poses, strict=True))


def _header(
    source: Path, pictures: Sequence[Path], described: Described, convention: Convention | None
) -> Header:
    height, width = _size(pictures)
    data: dict[str, Any] = {
        "schema": "cell.recording/1",
        "name": described.name or source.resolve().name,
        "robot": {"model": described.robot},
        "camera": {"model": None, "width": width, "height": height},
        "board": described.board,
        "mount": described.mount,
        "images": "images/",
        "imported": {"from": str(source), "poses": str(described.poses or "none")},
    }
    if convention is not None:
        data["imported"] |= {"rotation": convention.rotation, "unit": convention.unit}
        data["imported"]["guessed"] = list(convention.guessed)
    return Header.model_validate(data)


def _size(pictures: Sequence[Path]) -> tuple[int, int]:
    """(height, width) of the first picture that is one."""
    for picture in pictures:
        image = cv2.imdecode(np.fromfile(picture, np.uint8), cv2.IMREAD_UNCHANGED)
        if image is not None:
            return image.shape[0], image.shape[1]
    raise InputError(f"{pictures[0].parent}: none of the {len(pictures)} pictures is an image")


def _frame(
    frame: int,
    name: str,
    picture: Path,
    pose: RawPose | None,
    convention: Convention | None,
    inverted: bool,
) -> FrameRecord:
    values: dict[str, Any] = {"frame": frame, "image": name, "source": picture.name}
    if pose is not None and convention is not None:
        transform = convention.transform(pose)
        values["base_from_flange"] = PoseRecord.of(transform.inv() if inverted else transform)
    return FrameRecord.model_validate(values)


def _find_corners(
    recording: Recording, guessed: tuple[str, ...], progress: Progress | None
) -> Imported:
    if recording.has_detections:
        corners = recording.detections()
    else:
        corners = detect_corners(recording, progress)
        write_corners(recording.path / DETECTIONS, corners, recording.board)
    if not corners.px:
        reasons = "".join(
            f"\n  frame {frame}: {why}" for frame, why in list(corners.rejected.items())[:3]
        )
        raise BadAnswer(
            f"{recording.path}: the board was found in none of {len(recording.frames)} pictures."
            f" Check rows, cols and type of the board.{reasons}"
        )
    return Imported(
        recording.path, len(recording.frames), len(corners.px), guessed, dict(corners.rejected)
    )
