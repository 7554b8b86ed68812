"""What comes in from outside: the one place that decides paths, sizes and finiteness of it.

Every reader of a file (recordings, plans, cells, studies, calibrations, other tools' poses) gets
its bytes, its values, its pictures and the paths that stand in it from here. Names are loaded when
they are first used: `cell --help` needs none of the libraries that read pictures.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cell.storage.incoming.paths import inside, plain_file
    from cell.storage.incoming.pictures import decode_picture, read_picture
    from cell.storage.incoming.text import check_text, parse_json, read_bytes, read_text
    from cell.storage.incoming.values import check_values

__all__ = [
    "check_text",
    "check_values",
    "decode_picture",
    "inside",
    "parse_json",
    "plain_file",
    "read_bytes",
    "read_picture",
    "read_text",
]

_HOME = {
    "check_text": "text",
    "check_values": "values",
    "decode_picture": "pictures",
    "inside": "paths",
    "parse_json": "text",
    "plain_file": "paths",
    "read_bytes": "text",
    "read_picture": "pictures",
    "read_text": "text",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
