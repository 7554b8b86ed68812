"""Fanuc TP listings (`.ls`): every `P[n]` with X, Y, Z, W, P, R."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cell.verbs.importing.raw import RawPose, Series

_POSITION = re.compile(r"P\[(\d+)(?::[^\]]*)?\]\s*\{(.*?)\}", re.DOTALL)


def read(path: Path, text: str) -> list[Series]:
    """The positions in the listing's order: millimetres, degrees about fixed x, y, z."""
    poses = []
    for found in _POSITION.finditer(text):
        values = [
            re.search(rf"(?<!\w){letter}\s*=\s*([-+]?[\d.]+)", found[2]) for letter in "XYZWPR"
        ]
        if all(values):
            line = text.count("\n", 0, found.start()) + 1
            numbers = np.array([float(value[1]) for value in values if value])
            poses.append(RawPose(f"{path}:{line}", int(found[1]), numbers, ("rpy_deg",), "mm"))
    note = (
        "a Fanuc position is the tool in the user frame: it is the flange in the world where both"
        " were zero"
    )
    return [Series("Fanuc listing", "P[]", "flange", tuple(poses), (note,))] if poses else []
