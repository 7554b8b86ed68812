"""What comes in from outside: the one place that decides paths, sizes and finiteness of it.

Every reader of a file (recordings, plans, cells, studies, calibrations, other tools' poses) gets
its bytes, its values, its pictures and the paths that stand in it from here.
"""

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
