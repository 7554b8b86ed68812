"""ABB RAPID programs: every `robtarget`, named or within a move."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cell.verbs.importing.raw import RawPose, Series

_N = r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*"
_TARGET = re.compile(
    rf"(?:(\w+)\s*:=\s*)?\[\s*\[{_N},{_N},{_N}\]\s*,\s*\[{_N},{_N},{_N},{_N}\]\s*,"
    r"\s*\[(?:\s*-?\d+\s*,){3}\s*-?\d+\s*\]"
)
"""Position, quaternion w x y z, and the axis configuration that a `robtarget` alone has third."""


def read(path: Path, text: str) -> list[Series]:
    """The program's targets in its order: millimetres, scalar first."""
    poses = []
    for line, content in enumerate(text.splitlines(), 1):
        for found in _TARGET.finditer(content.partition("!")[0]):
            values = np.array([float(number) for number in found.groups()[1:]])
            poses.append(
                RawPose(f"{path}:{line}", None, values, ("quat_wxyz",), "mm", name=found[1])
            )
    note = (
        "a robtarget is the tool in the work object: it is the flange in the base where the"
        " program used tool0 and wobj0"
    )
    return [Series("RAPID program", "robtarget", "flange", tuple(poses), (note,))] if poses else []
