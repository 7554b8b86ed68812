"""Bags that unpack to more than they may are refused before the memory is taken."""

from __future__ import annotations

import bz2
import shutil
from collections import namedtuple
from collections.abc import Callable
from pathlib import Path
from typing import Any

import apsw
import lz4.frame
import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag1 import reader as ros1_reader
from rosbags.rosbag2 import CompressionMode, StoragePlugin, storage_mcap

from cell.errors import InputError
from cell.storage.incoming import limits
from cell.verbs.importing.bags.bag import open_bag
from cell.verbs.importing.bags.bounds import bounded_unpacking
from tests.cell import bags
from tests.cell.bags import Message, write_bag, write_ros1_bag

TOPIC = "/camera/image_raw"
PICTURE_BYTES = 200 * 100
FLAT: list[Message] = [
    (TOPIC, "sensor_msgs/msg/Image", at, bags.image(np.zeros((100, 200), np.uint8), "mono8", at))
    for at in (0.0, 0.1)
]


def _by_mcap_library(path: Path, compression: CompressionType) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file, compression=compression)
        text = bags.TYPES.generate_msgdef("sensor_msgs/msg/Image", ros_version=2)[0]
        schema = writer.register_msgdef("sensor_msgs/msg/Image", text)
        stamp = {"sec": 1, "nanosec": 0}
        content = {"header": {"stamp": stamp, "frame_id": ""}, "height": 100, "width": 200}
        content |= {"encoding": "mono8", "is_bigendian": 0, "step": 200}
        writer.write_message(TOPIC, schema, {**content, "data": bytes(PICTURE_BYTES)}, 1, 1)
        writer.finish()
    return path


def _by_rosbags(storage: StoragePlugin, mode: CompressionMode) -> Callable[[Path], Path]:
    return lambda folder: write_bag(folder / "bag", FLAT, storage, mode)


def _ros1(compression: Ros1Writer.CompressionFormat) -> Callable[[Path], Path]:
    return lambda folder: write_ros1_bag(folder / "one.bag", FLAT, compression)


KINDS: dict[str, Callable[[Path], Path]] = {
    "mcap, zstd": lambda folder: _by_mcap_library(folder / "z.mcap", CompressionType.ZSTD),
    "mcap, lz4": lambda folder: _by_mcap_library(folder / "l.mcap", CompressionType.LZ4),
    "mcap by rosbags": _by_rosbags(StoragePlugin.MCAP, CompressionMode.STORAGE),
    "sqlite3, messages": _by_rosbags(StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    "ROS 1, bz2": _ros1(Ros1Writer.CompressionFormat.BZ2),
    "ROS 1, lz4": _ros1(Ros1Writer.CompressionFormat.LZ4),
}


def _read(path: Path) -> list[Any]:
    with open_bag(path) as bag:
        return [message for _, _, message in bag.messages(bag.topics)]


@pytest.mark.parametrize("kind", KINDS)
def test_a_piece_over_the_bound_is_refused(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = KINDS[kind](tmp_path)
    assert all(message.data.size == PICTURE_BYTES for message in _read(path))
    monkeypatch.setattr(limits, "CHUNK_BYTES", PICTURE_BYTES - 1)
    with pytest.raises(InputError, match=f"piece .*unpacks to .*{limits.CHUNK_BYTES}|says that"):
        _read(path)


PACKED = {
    "lz4": lambda size: lz4.frame.compress(bytes(size)),
    "bz2": lambda size: bz2.compress(bytes(size)),
}


@pytest.mark.parametrize("how", PACKED)
def test_unpacking_stops_at_the_bound_or_the_declared_size(
    how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """4 MB of zeros that declare 1 MB or nothing; several frames; one that is cut off."""
    packed = PACKED[how](4 * 10**6)
    monkeypatch.setattr(limits, "CHUNK_BYTES", 3 * 10**6)
    before = dict(ros1_reader.decompressors), dict(storage_mcap.DECOMPRESSORS)
    with bounded_unpacking(Path("a.bag")):
        unpack = ros1_reader.decompressors[how]
        with pytest.raises(InputError, match="more than 3000000 bytes"):
            unpack(packed)
        if how in storage_mcap.DECOMPRESSORS:
            with pytest.raises(InputError, match="more than 1000000 bytes"):
                storage_mcap.DECOMPRESSORS[how](packed, 10**6)
        small = PACKED[how](1000)
        assert unpack(small) == bytes(1000)
        assert unpack(small + small) == bytes(2000)
        with pytest.raises(EOFError, match="cut off"):
            unpack(small[:-8])
    assert before == (dict(ros1_reader.decompressors), dict(storage_mcap.DECOMPRESSORS))


def test_a_file_that_unpacks_to_more_than_the_room_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag(tmp_path / "bag", FLAT, StoragePlugin.SQLITE3, CompressionMode.FILE)
    assert len(_read(path)) == len(FLAT)
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(0, 0, PICTURE_BYTES))
    with pytest.raises(InputError, match="half the room"):
        _read(path)


def test_pieces_that_overlap_in_time_count_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = KINDS["mcap, zstd"](tmp_path)
    monkeypatch.setattr(limits, "OPEN_CHUNKS_BYTES", PICTURE_BYTES)
    with pytest.raises(InputError, match="overlap in time"):
        _read(path)


def test_a_message_without_pixels_has_its_own_bound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    still = bags.transforms(bags.transform("base_link", "tool0", np.eye(4), 0.0))
    path = write_bag(tmp_path / "bag", [*FLAT, ("/tf", "tf2_msgs/msg/TFMessage", 0.0, still)])
    monkeypatch.setattr(limits, "MESSAGE_BYTES", 60)
    with pytest.raises(InputError, match=r"a message of /tf.* has .* bytes"):
        _read(path)


def test_a_column_that_is_computed_is_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its bytes stand in no file."""
    path = write_bag(tmp_path / "bag", FLAT, StoragePlugin.SQLITE3)
    (file,) = path.glob("*.db3")
    database = apsw.Connection(str(file))
    database.execute("ALTER TABLE messages RENAME TO stored")
    database.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
        " data BLOB AS (zeroblob(100000)))"
    )
    database.execute("INSERT INTO messages SELECT id, topic_id, timestamp FROM stored")
    database.close()
    monkeypatch.setattr(limits, "CHUNK_BYTES", 50000)
    with pytest.raises(InputError, match="too big"):
        _read(path)
