"""Bytes that are on the disk when the call returns, or an error in words."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path

from cell.errors import DiskFailed


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Turn what the disk refuses into `DiskFailed`; a file that is there already stays an error."""
    try:
        yield
    except FileExistsError:
        raise
    except OSError as fault:
        raise DiskFailed(
            f"{path}: the disk does not take it ({fault.strerror}). Free some space, or mend what"
            " keeps it from being written; what was logged before is whole"
        ) from None


def write_synced(file: FileIO, data: bytes) -> None:
    """Write all of `data` to an unbuffered file and sync it; raises `OSError`."""
    left = memoryview(data)
    while left:  # a disk that fills up takes a part of it first
        left = left[file.write(left) :]
    os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder; raises `OSError`."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
