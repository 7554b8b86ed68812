"""`cell import`: another tool's images and poses, or a recording, as a checked new recording."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.views import Board, FloatArray, Mount
from cell.errors import InputError
from cell.storage.incoming import plain_file, read_picture
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
from cell.storage.recording.detect import Progress, detect_in_pictures
from cell.verbs.importing.bags.bag import is_bag
from cell.verbs.importing.bags.importer import import_bag
from cell.verbs.importing.conventions import Candidate, Convention, conclude
from cell.verbs.importing.corner_lists import listed_corners
from cell.verbs.importing.described import Described
from cell.verbs.importing.joints import as_poses, in_order, radians
from cell.verbs.importing.outcome import Imported, checked, picture_check
from cell.verbs.importing.pairing import apply, pairings
from cell.verbs.importing.pose_files import flange_series, read_series
from cell.verbs.importing.raw import Series
from cell.verbs.importing.sources import common_size_px, pictures_in, pose_files_beside

_BOTH_MOUNTS = (
    "{one} OR {other} (say --mount): the pictures look the same either way and cannot show it"
)


@dataclass(frozen=True)
class _Posed:
    """(P, 4, 4) base_from_flange of each picture, (P, 6) joints, NaN without; how it was read."""

    matrices: FloatArray
    joints_rad: FloatArray
    convention: Convention
    guessed: tuple[str, ...]


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
    if is_bag(source):
        return import_bag(source, folder, described, progress)
    if plain_file(source / "recording.yaml"):
        _copy_recording(read_recording(source), folder)
        return checked(read_recording(folder), None, (), (), progress)
    if source.is_dir():
        return _import_pictures(source, folder, described, progress)
    raise InputError(f"{source}: is no folder of pictures, no recording and no ROS bag")


def _copy_recording(recording: Recording, folder: Path) -> None:
    """Copy a recording, checked: pictures as they are, every line whole."""
    pictures = {
        frame.frame: recording.picture(frame)
        for frame in recording.frames
        if frame.image is not None
    }
    with RecordingWriter.create(folder, recording.header) as writer:
        for frame in recording.frames:
            picture = pictures.get(frame.frame)
            if picture is not None and plain_file(picture):
                writer.adopt(picture, frame.image or "")
            writer.append(frame)
    if recording.has_detections:
        write_corners(folder / DETECTIONS, recording.detections(), recording.board)


def _import_pictures(
    source: Path, folder: Path, described: Described, progress: Progress | None
) -> Imported:
    pictures, notes = pictures_in(source)
    if described.board is None:
        raise InputError(
            "no board: give --board ROWSxCOLSxSQUARE in inner corners and metres, such"
            " as --board 6x9x0.025"
        )
    series = _series(described)
    size_px, sizes = common_size_px(pictures)
    notes += sizes
    header = _header(source, size_px, described)
    corners, posed = None, None
    if series or described.corners is not None:
        corners = _corners_of(header.board.board(), size_px, pictures, progress)
    if described.corners is not None and corners is not None:
        board = header.board.board()
        corners, order = listed_corners(described.corners, pictures, board, corners)
        notes += order
    if series and corners is not None:
        posed = _posed(series, pictures, corners, header.board.board(), described)
        header = header.model_copy(update={"imported": _import_record(header, posed)})
        notes += posed.guessed
    else:
        notes += _no_poses(source)
    with RecordingWriter.create(folder, header) as writer:
        for frame, picture in enumerate(pictures):
            name = f"images/{frame:05d}{picture.suffix.lower()}"
            writer.adopt(picture, name)
            writer.append(_frame(frame, name, picture, posed))
    against = () if posed is None else posed.convention.contradicted
    return checked(read_recording(folder), corners, notes, against, progress)


def _series(described: Described) -> list[Series]:
    """What can be the flange's poses: as written, or of joint angles through the kinematics."""
    if described.poses is None and described.joints is None:
        return []
    if described.poses is None:
        assert described.joints is not None
        found = read_series(described.joints)
        able = [s for s in found if s.role == "joints"] or _only(found)
        return [made for series in able for made in as_poses(series, described.robot)]
    found = read_series(described.poses)
    if all(series.role == "joints" for series in found):
        return [made for series in found for made in as_poses(series, described.robot)]
    able = flange_series(described.poses, found)
    left = [f"{s.key or s.layout}" for s in found if s.role == "board"]
    if left:
        note = f"{', '.join(dict.fromkeys(left))} is taken as the board's pose and not used"
        able = [series.with_notes(note) for series in able]
    return able


def _only(found: Sequence[Series]) -> list[Series]:
    """The one series of a file that the user says holds joint angles."""
    return [series for series in found if series.values.ndim == 2 and len(series.poses) > 1][:1]


def _joint_series(described: Described) -> Series | None:
    """Joint angles to put beside poses: from their own file, or the poses' file."""
    for path in (described.joints, described.poses):
        if path is None:
            continue
        found = read_series(path)
        able = [s for s in found if s.role == "joints"]
        if not able and path == described.joints:
            able = _only(found)
        for series in able:
            if all(len(pose.values) == 6 for pose in series.poses):
                return series
    return None


def _posed(
    series: Sequence[Series],
    pictures: Sequence[Path],
    corners: Corners,
    board: Board,
    described: Described,
) -> _Posed:
    names = [picture.name for picture in pictures]
    candidates = []
    for each in series:
        of = f", poses from {each.key}" if re.search("[a-z]", each.key) else ""
        notes = (f"the pose file is read as {each.layout}{of}", *each.notes)
        ways = pairings(names, each.poses, described.time_bound_s)
        candidates += [Candidate(each.poses, way, notes) for way in ways]
    mount: Mount = described.mount or "eye_in_hand"
    check = picture_check(len(pictures), corners, board, mount)
    chosen, convention = conclude(candidates, described.stated, check, board.square_m)
    matrices = np.array([convention.transform(pose).as_matrix() for pose in chosen.poses])
    guessed = convention.guessed
    if described.mount is None and described.stated.inverted is None and check is not None:
        guessed = (*guessed, _mount_or_direction(convention))
    return _Posed(
        apply(chosen.pairing, matrices),
        _joints(names, described),
        convention,
        guessed,
    )


def _mount_or_direction(convention: Convention) -> str:
    """The pair of readings that no picture distinguishes."""
    one, other = "base_from_flange", "flange_from_base"
    if convention.inverted:
        one, other = other, one
    return _BOTH_MOUNTS.format(
        one=f"the camera is on the flange and the poses are {one}",
        other=f"the camera stands still and the poses are {other}",
    )


def _joints(names: Sequence[str], described: Described) -> FloatArray:
    out = np.full((len(names), 6), np.nan)
    series = _joint_series(described)
    if series is None:
        return out
    angles = radians(in_order(series))
    if angles is None:
        return out
    pairing = pairings(names, series.poses, described.time_bound_s)[0]
    for picture, index in enumerate(pairing.poses):
        if index >= 0:
            out[picture] = angles[index]
    return out


def _corners_of(
    board: Board, size_px: tuple[int, int], pictures: Sequence[Path], progress: Progress | None
) -> Corners:
    loads = [(k, partial(read_picture, picture)) for k, picture in enumerate(pictures)]
    return detect_in_pictures(loads, board, size_px, progress)


def _header(source: Path, size_px: tuple[int, int], described: Described) -> Header:
    width, height = size_px
    data: dict[str, Any] = {
        "schema": "cell.recording/1",
        "name": described.name or source.resolve().name,
        "robot": {"model": described.robot},
        "camera": {"model": None, "width": width, "height": height},
        "board": described.board,
        "mount": described.mount or "eye_in_hand",
        "images": "images/",
        "imported": {"from": str(source), "poses": str(described.poses or described.joints or "")},
    }
    return Header.model_validate(data)


def _import_record(header: Header, posed: _Posed) -> dict[str, Any]:
    """What `recording.yaml` says of where the recording came from."""
    known = dict((header.model_extra or {})["imported"])
    read = posed.convention
    known |= {"rotation": read.rotation, "unit": read.unit, "inverted": read.inverted}
    return known | {"guessed": list(posed.guessed), "contradicted": list(read.contradicted)}


def _no_poses(source: Path) -> tuple[str, ...]:
    """What to say where no poses were given."""
    beside = pose_files_beside(source)
    hint = f"; {', '.join(beside[:3])} beside the pictures may hold them" if beside else ""
    return (f"no flange poses: the lens alone can be calibrated. Give --poses FILE{hint}",)


def _frame(frame: int, name: str, picture: Path, posed: _Posed | None) -> FrameRecord:
    values: dict[str, Any] = {"frame": frame, "image": name, "source": picture.name}
    if posed is not None and np.isfinite(posed.matrices[frame]).all():
        pose = RigidTransform.from_matrix(posed.matrices[frame])
        values["base_from_flange"] = PoseRecord.of(pose)
    if posed is not None and np.isfinite(posed.joints_rad[frame]).all():
        values["joints_rad"] = tuple(posed.joints_rad[frame].tolist())
    return FrameRecord.model_validate(values)
