"""`cell import`: another tool's images and poses, or a recording, as a checked new recording."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from calib.detection.orientation import pose_misfits
from calib.views import Board, FloatArray, Mount
from cell.errors import BadAnswer, InputError
from cell.storage.recording import (
    Corners,
    FrameRecord,
    Header,
    PoseRecord,
    Recording,
    RecordingWriter,
    read_recording,
    write_corners,
)
from cell.storage.recording.corners import FILE_NAME as DETECTIONS
from cell.storage.recording.detect import Progress, detect_corners
from cell.verbs.importing import RotationName, Unit
from cell.verbs.importing.conventions import Convention, Witness, conclude
from cell.verbs.importing.pose_files import RawPose, natural, number_in, read_poses

_ENOUGH_TO_ASK = 4
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
        How poses are written; `inverted`: they are flange_from_base. None where not said: then
        the pictures are asked.
    mount, robot, name:
        For `recording.yaml`.
    """

    board: dict[str, Any] | None = None
    poses: Path | None = None
    rotation: RotationName | None = None
    unit: Unit | None = None
    inverted: bool | None = None
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
    guessed: tuple[str, ...] = ()
    corners = None
    if (source / "recording.yaml").exists():
        _copy_recording(read_recording(source), folder)
    elif source.is_dir():
        guessed, corners = _import_pictures(source, folder, described, progress)
    else:
        raise InputError(f"{source}: is no folder of pictures and no recording")
    return _find_corners(read_recording(folder), guessed, corners, progress)


def _copy_recording(recording: Recording, folder: Path) -> None:
    """Copy a recording, checked: pictures as they are, every line whole."""
    with RecordingWriter.create(folder, recording.header) as writer:
        for frame in recording.frames:
            if frame.image is not None and (recording.path / frame.image).exists():
                (folder / frame.image).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(recording.path / frame.image, folder / frame.image)
            writer.append(frame)
    if recording.has_detections:
        write_corners(folder / DETECTIONS, recording.detections(), recording.board)


def _import_pictures(
    source: Path, folder: Path, described: Described, progress: Progress | None
) -> tuple[tuple[str, ...], Corners | None]:
    """What was concluded and not said, and the corners where the pictures were asked."""
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
    pairs = _pairs(pictures, poses)
    header = _header(source, pictures, described)
    convention, corners = None, None
    if poses:
        corners = _corners_of(source, header, pictures, progress)
        witness = _witness(pairs, corners, header.board.board(), described.mount)
        asked = [pose for _, pose in pairs if pose is not None]
        said = (described.rotation, described.unit, described.inverted)
        convention = conclude(asked, *said, witness)
        header = header.model_copy(update={"imported": _told(header, convention)})
    with RecordingWriter.create(folder, header) as writer:
        for frame, (picture, pose) in enumerate(pairs):
            name = f"images/{frame:05d}{picture.suffix.lower()}"
            shutil.copy2(picture, folder / name)
            writer.append(_frame(frame, name, picture, pose, convention))
    return () if convention is None else convention.guessed, corners


def _corners_of(
    source: Path, header: Header, pictures: Sequence[Path], progress: Progress | None
) -> Corners:
    frames = [FrameRecord(frame=k, image=picture.name) for k, picture in enumerate(pictures)]
    return detect_corners(Recording(source, header, tuple(frames)), progress)


def _witness(
    pairs: Sequence[tuple[Path, RawPose | None]], corners: Corners, board: Board, mount: Mount
) -> Witness | None:
    """What the whole boards among the pictures say of a reading of the poses."""
    posed = [k for k, (_, pose) in enumerate(pairs) if pose is not None]
    whole = [
        k for k, frame in enumerate(posed)
        if frame in corners.px and np.isfinite(corners.px[frame]).all()
    ]  # fmt: skip
    if len(whole) < _ENOUGH_TO_ASK:
        return None
    seen = np.array([corners.px[posed[k]] for k in whole])

    def misfits(readings: Sequence[FloatArray]) -> FloatArray:
        return pose_misfits(seen, board, [reading[whole] for reading in readings], mount)

    return misfits


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


def _header(source: Path, pictures: Sequence[Path], described: Described) -> Header:
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
    return Header.model_validate(data)


def _told(header: Header, convention: Convention) -> dict[str, Any]:
    """What `recording.yaml` says of where the recording came from."""
    known = dict((header.model_extra or {})["imported"])
    known |= {"rotation": convention.rotation, "unit": convention.unit}
    return known | {"inverted": convention.inverted, "guessed": list(convention.guessed)}


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
) -> FrameRecord:
    values: dict[str, Any] = {"frame": frame, "image": name, "source": picture.name}
    if pose is not None and convention is not None:
        values["base_from_flange"] = PoseRecord.of(convention.transform(pose))
    return FrameRecord.model_validate(values)


def _find_corners(
    recording: Recording,
    guessed: tuple[str, ...],
    corners: Corners | None,
    progress: Progress | None,
) -> Imported:
    if recording.has_detections:
        corners = recording.detections()
    else:
        corners = detect_corners(recording, progress) if corners is None else corners
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
