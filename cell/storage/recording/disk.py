"""Bytes that are on the disk when the call returns, or an error in words."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path

from cell.errors import DiskFailed


@contextmanager
def disk_errors(path: Path) -> Iterator[None]:
    """Turn what the disk refuses into `DiskFailed`."""
    try:
        yield
    except OSError as fault:
        raise DiskFailed(_message(path, fault)) from None


def _message(path: Path, fault: OSError) -> str:
    if isinstance(fault, FileExistsError):
        return (
            f"{fault.filename or path}: is there already and is never overwritten. Move it away, or"
            " start anew with another -o"
        )
    if fault.errno in (errno.EMFILE, errno.ENFILE):
        return (
            f"{path}: no file descriptor is left to write it with ({fault.strerror}). Raise the"
            " limit (ulimit -n), or end what holds so many files and connections open"
        )
    if isinstance(fault, FileNotFoundError):
        return (
            f"{fault.filename or path}: is not there any more; somebody moved or deleted {path}"
            " while the run wrote it. Move it back to go on with it; what was logged is whole"
        )
    return (
        f"{path}: the disk does not take it ({fault.strerror}). Free some space, or mend what"
        " keeps it from being written; what was logged before is whole"
    )


def write_synced(file: FileIO, data: bytes) -> None:
    """Write all of `data` to an unbuffered file and sync it; raises `OSError`."""
    left = memoryview(data)
    while left:  # a disk that fills up takes a part of it first
        left = left[file.write(left) :]
    os.fsync(file.fileno())
