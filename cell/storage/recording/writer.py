"""Writing a recording as it happens: nothing written is ever lost or overwritten."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from cell.errors import InputError
from cell.storage.files.writing import yaml_text
from cell.storage.recording import disk
from cell.storage.recording import frames as frame_file
from cell.storage.recording import header as header_file
from cell.storage.recording.frames import FrameRecord, read_frames
from cell.storage.recording.header import Header, write_header

_PNG_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1]
UNLOGGED = "unlogged"


class RecordingWriter:
    """Appends frames to a recording; each is on the disk when `append` returns.

    The picture is written and synced first, then the line that names it, so that whatever
    instant the process dies at, every line's picture is whole. Use it as a context manager.
    """

    def __init__(self, folder: Path, header: Header) -> None:
        self.folder = folder
        self.header = header
        self._lines = (folder / frame_file.FILE_NAME).open("ab", buffering=0)

    @classmethod
    def create(cls, folder: Path, header: Header) -> RecordingWriter:
        """Start a new recording; raises `InputError` where one exists already."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if header.images:
                (folder / header.images).mkdir(exist_ok=True)
            if (folder / frame_file.FILE_NAME).exists():
                raise FileExistsError
            write_header(folder, header)
        except FileExistsError:
            raise InputError(
                f"{folder}: a recording is there already and is never overwritten."
                " Give another -o, or go on with it (--resume)."
            ) from None
        except OSError as fault:
            raise InputError(f"{folder}: cannot be written: {fault.strerror}") from None
        _sync_file(folder / header_file.FILE_NAME)
        disk.sync_folder(folder)
        return cls(folder, header)

    @classmethod
    def resume(cls, folder: Path) -> tuple[RecordingWriter, tuple[FrameRecord, ...]]:
        """Go on with a recording; returns the writer and the frames it already has.

        A half-written last line is cut off. Pictures that no line names yet are moved to
        `images/unlogged/`, so that nothing is overwritten.
        """
        header = header_file.read_header(folder)
        lines = folder / frame_file.FILE_NAME
        frames: tuple[FrameRecord, ...] = ()
        if lines.exists():
            _cut_half_line(lines)
            frames = read_frames(lines)
        if header.images:
            _set_unlogged_aside(folder / header.images, folder, frames)
        return cls(folder, header), frames

    def append(self, record: FrameRecord, image: NDArray[np.generic] | None = None) -> FrameRecord:
        """Write one frame; returns its line with the picture's path in it.

        Raises
        ------
        FileExistsError
            The recording has a picture of that frame number already.
        DiskFailed
            The disk does not take it.
        """
        with disk.told(self.folder):
            if image is not None:
                record = record.model_copy(update={"image": self._write_image(record.frame, image)})
            disk.write_synced(self._lines, record.as_line().encode())
        return record

    def _write_image(self, frame: int, image: NDArray[np.generic]) -> str:
        name = Path(self.header.images or "images") / f"{frame:05d}.png"
        encoded = cv2.imencode(".png", cast("NDArray[np.integer[Any]]", image), _PNG_FAST)[1]
        with (self.folder / name).open("xb", buffering=0) as file:
            disk.write_synced(file, encoded.tobytes())
        disk.sync_folder((self.folder / name).parent)
        return name.as_posix()

    def say(self, **values: Any) -> None:
        """Put further keys into `recording.yaml`, None to take one away; it is replaced whole."""
        extra = self.header.model_extra or {}
        kept = {k: v for k, v in {**extra, **values}.items() if v is not None}
        if kept == extra:
            return
        told = self.header.as_mapping()
        told = {k: v for k, v in told.items() if k not in extra} | kept
        self.header = Header.model_validate(told)
        partial = self.folder / f"{header_file.FILE_NAME}.part"
        with disk.told(self.folder):
            partial.write_text(yaml_text(told), encoding="utf-8")
            _sync_file(partial)
            partial.replace(self.folder / header_file.FILE_NAME)
            disk.sync_folder(self.folder)

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


def _set_unlogged_aside(images: Path, folder: Path, frames: tuple[FrameRecord, ...]) -> None:
    images.mkdir(exist_ok=True)
    named = {(folder / frame.image).name for frame in frames if frame.image}
    for file in sorted(images.iterdir()):
        if file.is_file() and file.name not in named:
            aside = images / UNLOGGED
            aside.mkdir(exist_ok=True)
            taken = sum(1 for other in aside.iterdir() if other.stem.startswith(file.stem))
            file.rename(aside / f"{file.stem}-{taken}{file.suffix}")


def _sync_file(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
