"""KUKA programs and frame lists: `E6POS`, `POS` and `FRAME` with X, Y, Z, A, B, C."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cell.verbs.importing.raw import RawPose, Series

_N = r"\s+([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*"
_FRAME = re.compile(
    r"(?:(\w+(?:\[\d+\])?)\s*=\s*)?\{\s*(?:E6POS:|POS:|FRAME:)?\s*"
    + r",\s*".join(letter + _N for letter in "XYZABC"),
    re.IGNORECASE,
)


def read(path: Path, text: str) -> list[Series]:
    """The frames in their order: millimetres, degrees about moving z, y, x."""
    poses = []
    for line, content in enumerate(text.splitlines(), 1):
        if content.lstrip().startswith(";"):
            continue
        for found in _FRAME.finditer(content):
            values = np.array([float(number) for number in found.groups()[1:]])
            poses.append(
                RawPose(f"{path}:{line}", None, values, ("euler_zyx_deg",), "mm", name=found[1])
            )
    note = (
        "a KUKA position is the tool in the base that was active: it is the flange in the robot's"
        " root where both were zero"
    )
    return [Series("KUKA frames", "E6POS", "flange", tuple(poses), (note,))] if poses else []
