"""How large what comes in may be; each far above what a cell produces."""

from __future__ import annotations

from typing import Final

MIB: Final = 2**20

YAML_BYTES: Final = 8 * MIB
"""Plans, cells, studies, headers: a plan of 20 000 views. YAML is read slowly."""
JSON_BYTES: Final = 256 * MIB
"""Results and other tools' poses."""
POSES_BYTES: Final = 32 * MIB
"""Poses in another tool's layout: a hundred thousand."""
LOG_BYTES: Final = 1024 * MIB
"""`frames.jsonl` and `detections.csv`: a million lines."""
PICTURE_BYTES: Final = 512 * MIB
"""A picture's file."""

CHUNK_BYTES: Final = 512 * MIB
"""What one compressed piece of a bag unpacks to: more than the largest picture's 400 MB."""
OPEN_CHUNKS_BYTES: Final = 1024 * MIB
"""Of a bag's pieces whose times overlap, which are held together."""
MESSAGE_BYTES: Final = 4 * MIB
"""A message without pixels: twenty thousand transforms, or a robot's description."""
MESSAGES: Final = 4_000_000
"""Of a bag without their pixels: joints at 1 kHz for an hour."""

PICTURE_PIXELS: Final = 2**26
"""Pixels of a picture, 8192 x 8192: the largest area sensors of machine vision have 65 Mpx."""
PICTURE_SIDE: Final = 2**16
"""Pixels of a picture's side: what its file formats can write."""

NESTING: Final = 64
"""Depth of lists and mappings in each other."""
VALUES: Final = 2_000_000
"""Values in a file, with everything that an alias repeats counted every time."""
MAGNITUDE: Final = 1e20
"""No number is larger: a camera's clock that counts nanoseconds since 1970 stands at 1.8e18, and
64 bits end at 1.8e19."""
SMALLEST: Final = 1e-12
"""What must be positive is larger: a picosecond, a picometre."""
DIGITS: Final = 400
"""Digits of a number as text."""
LINE_CHARACTERS: Final = 100_000
"""Of a line in a log, or of a cell in a table."""

BOARD_SIDE: Final = 1000
"""Corners, squares or tags along a board's side."""
BOARD_CORNERS: Final = 20_000
"""Corners of a board."""
CORNERS: Final = 2**24
"""Corners of a recording: frames times the board's corners."""
FRAME_NUMBER: Final = 2**53
"""Of a frame: what every JSON reader keeps exactly."""
JOINTS: Final = 32
"""Joints of an arm."""
PIXELS: Final = 1e7
"""A pixel coordinate, also of a corner far outside the picture."""
REACH_M: Final = 1e5
"""A position in a log, also where it is in millimetres."""
DISTANCE_M: Final = 1e4
"""Of a board, a lens's focus, a work piece."""
VIEWS: Final = 20_000
"""Views of a plan."""
TASKS: Final = 1_000_000
"""Seeds of a study, and what it makes of them."""
DURATION_S: Final = 86_400.0
"""Of one thing that is waited for."""
