"""Writing a recording as it happens: nothing written is ever lost or overwritten."""

from __future__ import annotations

import os
import re
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from cell.errors import InputError
from cell.storage.atomic import sync_folder, write_atomically
from cell.storage.files.writing import yaml_text
from cell.storage.incoming import inside, plain_file, read_bytes
from cell.storage.incoming.limits import PICTURE_BYTES
from cell.storage.incoming.paths import reason
from cell.storage.recording import disk
from cell.storage.recording import frames as frame_file
from cell.storage.recording import header as header_file
from cell.storage.recording.file_watch import FileWatch
from cell.storage.recording.frame_log import read_frames
from cell.storage.recording.frames import FrameRecord
from cell.storage.recording.header import Header, write_header

_PNG_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1]
UNLOGGED = "unlogged"
_OWN_NAME = re.compile(r"\d{5,}\.png")
_SHOWN_AT_MOST = 5


class RecordingWriter:
    """Appends frames to a recording; each is on the disk when `append` returns.

    The picture is written and synced first, then the line that names it, so that whatever
    instant the process dies at, every line's picture is whole. Use it as a context manager.
    """

    def __init__(self, folder: Path, header: Header) -> None:
        self.folder = folder
        self.header = header
        self._images = pictures_folder(folder, header)
        lines = inside(folder, frame_file.FILE_NAME, f"{folder}")
        self._lines = lines.open("ab", buffering=0)
        self._kept = FileWatch(self._lines, lines, self._images)

    @classmethod
    def create(cls, folder: Path, header: Header) -> RecordingWriter:
        """Start a new recording; raises `InputError` where one exists already."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            images = pictures_folder(folder, header)
            if images is not None:
                images.mkdir(parents=True, exist_ok=True)
            if inside(folder, frame_file.FILE_NAME, f"{folder}").exists():
                raise FileExistsError
            write_header(folder, header)
        except FileExistsError:
            raise InputError(
                f"{folder}: a recording is there already and is never overwritten."
                " Give another -o, or go on with it (--resume)."
            ) from None
        except (OSError, ValueError) as fault:
            raise InputError(f"{folder}: cannot be written: {reason(fault)}") from None
        _sync_file(folder / header_file.FILE_NAME)
        sync_folder(folder)
        return cls(folder, header)

    @classmethod
    def resume(cls, folder: Path) -> tuple[RecordingWriter, tuple[FrameRecord, ...]]:
        """Go on with a recording; returns the writer and the frames it already has.

        A half-written last line is cut off. Pictures that no line names yet are moved to
        `images/unlogged/`, so that nothing is overwritten.

        Raises
        ------
        InputError
            A file of it is broken or leads elsewhere, or a line's picture is missing.
        """
        header = header_file.read_header(folder)
        lines = inside(folder, frame_file.FILE_NAME, f"{folder}")
        images = pictures_folder(folder, header)
        frames: tuple[FrameRecord, ...] = ()
        try:
            if plain_file(lines):
                _cut_half_line(lines)
                frames = read_frames(lines).frames
            if images is not None:
                _check_pictures(folder, frames)
                images.mkdir(parents=True, exist_ok=True)
                _set_unlogged_aside(images, folder, frames)
            writer = cls(folder, header)
            for frame in frames:
                writer._kept.line_written(frame)
            return writer, frames
        except OSError as fault:
            raise InputError(
                f"{folder}: cannot be gone on with: {fault.filename}: {reason(fault)}"
            ) from None

    def append(self, record: FrameRecord, image: NDArray[np.generic] | None = None) -> FrameRecord:
        """Write one frame; returns its line with the picture's path in it.

        Raises
        ------
        DiskFailed
            The disk does not take it, the recording has a picture of that frame number already, or
            what was written before was deleted or replaced meanwhile.
        """
        with disk.disk_errors(self.folder):
            self._kept.check()
            if image is not None:
                record = record.model_copy(update={"image": self._write_image(record.frame, image)})
            disk.write_synced(self._lines, record.as_line().encode())
            self._kept.line_written(record)
        return record

    def check_complete(self) -> None:
        """Raise `DiskFailed` where anything that this writer wrote is no longer in its place."""
        with disk.disk_errors(self.folder):
            self._kept.check_all()

    def adopt(self, picture: Path, name: str) -> None:
        """Copy a picture from elsewhere into the recording under a name relative to its folder.

        Raises
        ------
        InputError
            It cannot be read, or the name leads out of the recording or is taken.
        DiskFailed
            The disk does not take it.
        """
        data = read_bytes(picture, PICTURE_BYTES)
        there = inside(self.folder, name, f"{self.folder}: picture")
        with disk.disk_errors(self.folder):
            there.parent.mkdir(parents=True, exist_ok=True)
            _write_new_file(there, data)

    def _write_image(self, frame: int, image: NDArray[np.generic]) -> str:
        images = self._images or self.folder / "images"
        encoded = cv2.imencode(".png", cast("NDArray[np.integer[Any]]", image), _PNG_FAST)[1]
        path = images / f"{frame:05d}.png"
        _write_new_file(path, encoded.tobytes())
        return path.relative_to(self.folder).as_posix()

    def say(self, **values: Any) -> None:
        """Put further keys into `recording.yaml`, None to take one away; it is replaced whole."""
        extra = self.header.model_extra or {}
        kept = {k: v for k, v in {**extra, **values}.items() if v is not None}
        if kept == extra:
            return
        header = {k: v for k, v in self.header.as_mapping().items() if k not in extra} | kept
        self.header = Header.model_validate(header)
        write_atomically(self.folder / header_file.FILE_NAME, yaml_text(header))

    def close(self) -> None:
        """Let go of the files. Idempotent."""
        self._lines.close()

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _cut_half_line(lines: Path) -> None:
    """End the file after its last whole line."""
    data = lines.read_bytes()
    end = data.rfind(b"\n") + 1
    if data[end:]:
        with lines.open("r+b") as file:
            file.truncate(end)
            os.fsync(file.fileno())


def pictures_folder(folder: Path, header: Header) -> Path | None:
    """Where a recording's pictures are, None where it keeps none; `InputError` if elsewhere."""
    if not header.images:
        return None
    return inside(folder, header.images, f"{folder / header_file.FILE_NAME}: images")


def _check_pictures(folder: Path, frames: tuple[FrameRecord, ...]) -> None:
    """Refuse to go on with lines whose pictures are gone or empty."""
    named = [frame for frame in frames if frame.image is not None]
    where = folder / frame_file.FILE_NAME
    paths = {f.frame: inside(folder, f.image or "", f"{where}: frame {f.frame}") for f in named}
    lost = [n for n, path in paths.items() if not (plain_file(path) and path.stat().st_size)]
    if lost:
        shown = ", ".join(map(str, lost[:_SHOWN_AT_MOST])) + (
            " ..." if len(lost) > _SHOWN_AT_MOST else ""
        )
        raise InputError(
            f"{where}: the pictures of {len(lost)} frames are missing or empty (frames {shown})."
            " Put them back, or start anew with another -o."
        )


def _set_unlogged_aside(images: Path, folder: Path, frames: tuple[FrameRecord, ...]) -> None:
    """Move our own pictures that no line names; whatever else lies there stays."""
    named = {(folder / frame.image).name for frame in frames if frame.image}
    aside = images / UNLOGGED
    for file in sorted(images.iterdir()):
        if not _OWN_NAME.fullmatch(file.name) or file.name in named or file.is_symlink():
            continue
        if file.is_file():
            aside.mkdir(exist_ok=True)
            file.rename(_free_name(aside, file))


def _free_name(aside: Path, file: Path) -> Path:
    names = (aside / f"{file.stem}-{number}{file.suffix}" for number in count())
    return next(name for name in names if not name.exists())


def _write_new_file(path: Path, data: bytes) -> None:
    """Write and sync a file that is not there yet; raises `OSError`."""
    with path.open("xb", buffering=0) as file:
        disk.write_synced(file, data)
    sync_folder(path.parent)


def _sync_file(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
