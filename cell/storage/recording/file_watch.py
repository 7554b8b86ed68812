"""Whether what a recording's writer wrote is still in its place: inode, size and count."""

from __future__ import annotations

import os
from io import FileIO
from pathlib import Path

from cell.errors import DiskFailed
from cell.storage.recording.frames import FrameRecord
from cell.storage.recording.header import FILE_NAME as HEADER


class FileWatch:
    """Watches over a recording while it is written.

    A file that somebody deletes goes on taking lines that nobody will ever find; so before every
    frame the names are looked up again.

    Parameters
    ----------
    lines, path:
        `frames.jsonl`, opened to append, and its name.
    images:
        Folder of the pictures, or None where none are kept.
    """

    def __init__(self, lines: FileIO, path: Path, images: Path | None) -> None:
        self._lines, self._path, self._images = lines, path, images
        status = os.fstat(lines.fileno())
        self._inode, self._size = (status.st_dev, status.st_ino), status.st_size
        self._folder = None if images is None else _inode(images)
        self._pictures: dict[Path, int] = {}

    def line_written(self, record: FrameRecord) -> None:
        """Take note of a frame that was written; raises `OSError`."""
        self._size = os.fstat(self._lines.fileno()).st_size
        if record.image is not None and self._images is not None:
            picture = self._path.parent / record.image
            self._pictures[picture] = picture.stat().st_size

    def check(self) -> None:
        """Raise `DiskFailed` where log, header, pictures or their folder are not as written."""
        status = _status(self._path)
        if status is None or (status.st_dev, status.st_ino) != self._inode:
            raise gone(self._path)
        if status.st_size != self._size:
            raise DiskFailed(
                f"{self._path}: has {status.st_size} bytes where this run wrote {self._size}:"
                " somebody else writes to it. Keep the recording for this run alone."
            )
        header = self._path.parent / HEADER
        if _status(header) is None:
            raise gone(header)
        if self._images is not None and _inode(self._images) != self._folder:
            raise gone(self._images)
        if self._pictures:
            self._check_picture(next(reversed(self._pictures)))

    def check_all(self) -> None:
        """As `check`, and every picture written."""
        self.check()
        for picture in self._pictures:
            self._check_picture(picture)

    def _check_picture(self, picture: Path) -> None:
        status = _status(picture)
        if status is None or status.st_size != self._pictures[picture]:
            raise gone(picture)


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.stat()
    except FileNotFoundError:
        return None


def _inode(path: Path) -> tuple[int, int] | None:
    status = _status(path)
    return None if status is None else (status.st_dev, status.st_ino)


def gone(path: Path) -> DiskFailed:
    """The error for a file of a recording that is no longer what was written."""
    return DiskFailed(
        f"{path}: was deleted, cut or replaced while the run wrote the recording; frames of it are"
        " lost. Keep other programs away from the folder, and record anew with another -o."
    )
