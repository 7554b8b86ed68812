"""Small recordings to test on, made here."""

from __future__ import annotations

import json
from typing import Any

HEADER = """\
schema: cell.recording/1
name: bench
robot: {model: ur5e}
camera: {model: bench-camera, width: 64, height: 48, focus: auto}
board: {type: chessboard, rows: 2, cols: 3, square_m: 0.025}
images: null
"""
POSE = {"p_m": [0.5, 0.0, 0.4], "q_xyzw": [0.0, 1.0, 0.0, 0.0]}


def frame_line(frame: int, **values: Any) -> str:
    record = {"frame": frame, "image": None, "t_s": 1.5 * frame, "base_from_flange": POSE}
    return json.dumps({**record, "joints_rad": [0.1] * 6, **values}) + "\n"


def corner_rows(frame: int) -> str:
    rows = [f"{frame},{r},{c},{10 + 5 * c + frame},{8 + 5 * r}\n" for r in (0, 1) for c in range(3)]
    return "".join(rows)
