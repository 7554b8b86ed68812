"""How much memory a bag may take: a small file can unpack to any size.

rosbags 0.11.9 unpacks a piece in one call and compares with the size that the bag declares only
afterwards. Its tables of decompressors get ours while a bag is open, which stop at the bound.
"""

from __future__ import annotations

import bz2
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from threading import RLock
from types import SimpleNamespace
from typing import Any, BinaryIO, Self
from unittest.mock import patch

from cell.errors import InputError
from cell.storage.incoming import limits

_STEP_BYTES = 16 * limits.MIB
_ONE_BAG = RLock()
"""The tables are the library's, of the whole process."""


@contextmanager
def bounded_unpacking(path: Path) -> Iterator[None]:
    """While it lasts, rosbags unpacks no more than `limits.CHUNK_BYTES` at once.

    Raises
    ------
    InputError
        There, where a piece of the bag `path` unpacks to more.
    """
    ros1, ros2 = _module("rosbags.rosbag1.reader"), _module("rosbags.rosbag2.reader")
    mcap, zstd = _module("rosbags.rosbag2.storage_mcap"), ros2.zstd

    def bounded(new: Callable[[], Any]) -> Callable[..., bytes]:
        return lambda data, size=None: _unpacked(new, data, size, path)

    lz4, zst = bounded(_module("lz4.frame").LZ4FrameDecompressor), bounded(zstd.ZstdDecompressor)
    unpackers = {"none": bytes, "bz2": bounded(bz2.BZ2Decompressor), "lz4": lz4}
    chunks = {"": lambda data, _: data, "lz4": lz4, "zstd": zst}

    def opened(file: BinaryIO, mode: str) -> _Rationed:
        return _Rationed(zstd.open(file, mode), path)

    module = SimpleNamespace(open=opened, decompress=zst)
    with _ONE_BAG, ExitStack() as stack:
        stack.enter_context(patch.dict(ros1.decompressors, unpackers, clear=True))
        stack.enter_context(patch.dict(mcap.DECOMPRESSORS, chunks, clear=True))
        stack.enter_context(patch.object(ros2, "zstd", module))
        yield


class _Rationed:
    """A file that was compressed whole, which rosbags unpacks into the temporary folder."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        self._file, self._path = file, path
        self._room = shutil.disk_usage(tempfile.gettempdir()).free // 2

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def read(self, size: int) -> bytes:
        """Up to `size` bytes; raises `InputError` beyond half the room that there was."""
        data = self._file.read(size)
        self._room -= len(data)
        if self._room < 0:
            raise InputError(
                f"{self._path}: unpacks to more than half the room in {tempfile.gettempdir()}."
                " Unpack it with `zstd -d` or `ros2 bag convert` elsewhere, or set TMPDIR"
            )
        return data


def _module(name: str) -> Any:
    return import_module(name)


def _unpacked(new: Callable[[], Any], data: bytes, size: int | None, path: Path) -> bytes:
    """The bytes, of one frame or several; `size` as the bag declares it, None where it does not."""
    most = limits.CHUNK_BYTES
    if size is not None and size > most:
        raise _too_large(path, f"a compressed piece says that it unpacks to {size} bytes")
    if size is not None:
        most = size  # a byte more is no longer what was declared
    pieces: list[bytes] = []
    total = 0
    for piece in _pieces(new, data):
        pieces.append(piece)
        total += len(piece)
        if total > most:
            raise _too_large(path, f"a compressed piece unpacks to more than {most} bytes")
    return pieces[0] if len(pieces) == 1 else b"".join(pieces)


def _pieces(new: Callable[[], Any], data: bytes) -> Iterator[bytes]:
    while data:
        frame = new()
        yield frame.decompress(data, _STEP_BYTES)
        while not frame.eof:
            if frame.needs_input:
                raise EOFError("a compressed piece is cut off")
            yield frame.decompress(b"", _STEP_BYTES)
        data = frame.unused_data or b""


def check_storages(path: Path, reader: Any) -> None:
    """Bound what an open bag's files give at once.

    Raises
    ------
    InputError
        An MCAP's pieces overlap in time so that more than `limits.OPEN_CHUNKS_BYTES` are held.
    """
    for part in reader.readers:
        storage = getattr(part, "storage", None)
        for file in getattr(storage, "storages", [storage]):
            _check_overlap(path, getattr(file, "chunks", []))
            if getattr(file, "dbconn", None) is not None:
                # a column that is computed has values of any size in a small file
                file.dbconn.limit(_module("apsw").SQLITE_LIMIT_LENGTH, limits.CHUNK_BYTES)


def _check_overlap(path: Path, chunks: Any) -> None:
    """Of an MCAP: pieces whose times overlap are unpacked together to be merged."""
    changes: list[tuple[int, int, int]] = []
    for chunk in chunks:
        first, last, size = (
            chunk.message_start_time,
            chunk.message_end_time,
            chunk.uncompressed_size,
        )
        # at one time, those that begin come before those that end
        changes += [(first, 0, size), (max(first, last), 1, -size)]
    held = 0
    for _, _, change in sorted(changes):
        held += change
        if held > limits.OPEN_CHUNKS_BYTES:
            what = f"its pieces overlap in time, so that {held} bytes are needed together"
            raise _too_large(path, f"{what} (`mcap sort` mends it)")


def check_message(path: Path, topic: str, data: bytes, *, pixels: bool) -> None:
    """Raise `InputError` for a message that is larger than any of its kind."""
    most = limits.CHUNK_BYTES if pixels else limits.MESSAGE_BYTES
    if len(data) > most:
        raise _too_large(path, f"a message of {topic} has {len(data)} bytes (at most {most})")


def _too_large(path: Path, what: str) -> InputError:
    return InputError(
        f"{path}: {what}, more than a bag of pictures and poses has. Is it the bag that is meant?"
        " `mcap filter` or `ros2 bag convert` take the topics that are needed out of it"
    )
