"""A ROS bag opened, and its messages one after the other."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cell.errors import InputError
from cell.storage.incoming import plain_file, read_bytes
from cell.storage.incoming.limits import YAML_BYTES
from cell.verbs.importing.bags.bounds import bounded_unpacking, check_message, check_storages

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
PICTURES = (IMAGE, COMPRESSED)
"""Types of the messages that have pixels."""

_FILES = (".mcap", ".db3", ".bag")
_METADATA = "metadata.yaml"
_INSTALL = "reading ROS bags needs one more package: pip install 'calibration-cell[ros]'"
_MEND = (
    "If the recording was cut off, mend it first: `ros2 bag reindex` for a folder or .db3,"
    " `mcap recover` for an .mcap"
)


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: its name, the type of its messages (`pkg/msg/Name`), how many."""

    name: str
    type: str
    count: int


class Bag:
    """An open bag.

    Attributes
    ----------
    path:
        Of the bag.
    topics:
        Those with messages, by name.
    """

    def __init__(self, path: Path, reader: Any) -> None:
        self.path = path
        self._reader = reader
        self.topics = {
            name: Topic(name, about.msgtype or "", about.msgcount)
            for name, about in sorted(reader.topics.items())
            if about.msgcount
        }

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        """Topic, time of receipt in ns, and message, in the order of receipt."""
        chosen = [c for c in self._reader.connections if c.topic in topics]
        if not chosen:
            return
        for connection, time_ns, data in self._reader.messages(connections=chosen):
            pixels = connection.msgtype in PICTURES
            check_message(self.path, connection.topic, data, pixels=pixels)
            yield connection.topic, time_ns, self._reader.deserialize(data, connection.msgtype)


def is_bag(source: Path) -> bool:
    """Whether a path is a bag's file or the folder of one."""
    if source.is_dir():
        return _storage(source)
    return source.suffix.lower() in _FILES


def _storage(folder: Path) -> bool:
    return plain_file(folder / _METADATA) and any(
        file.name.removesuffix(".zstd").endswith(_FILES) for file in folder.iterdir()
    )


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """A bag to read from.

    Raises
    ------
    InputError
        It cannot be read, here or while its messages are, or the package for it is missing.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(f"{path}: {_INSTALL}") from None
    if not path.is_dir() and not plain_file(path):
        raise InputError(f"{path}: is not there")
    if path.is_dir():
        read_bytes(path / _METADATA, YAML_BYTES)  # refuses what is too large to be one
    try:
        # bags of sqlite3 carried no definitions of their messages up to ROS 2 Humble
        usual = get_typestore(Stores.LATEST)
        with bounded_unpacking(path), AnyReader([path], default_typestore=usual) as reader:
            check_storages(path, reader)
            yield Bag(path, reader)
    except InputError:
        raise
    except Exception as fault:  # the package documents no bound to what broken bytes raise
        why = " ".join(str(fault).split())[:200] or type(fault).__name__
        raise InputError(f"{path}: cannot be read as a ROS bag: {why}. {_MEND}") from None
