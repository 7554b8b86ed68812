"""Position lists of Yaskawa, Mitsubishi and others: a name, then six numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cell.verbs.importing.raw import RawPose, Series

_N = r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*"
_SIX = ",".join([_N] * 6)
_LINE = re.compile(rf"^\s*(?:DEF\s+POS\s+)?([A-Za-z]\w*)\s*=\s*\(?{_SIX}(?:,|\)|$)", re.MULTILINE)


def read(path: Path, text: str) -> list[Series]:
    """`P00001=x,y,z,rx,ry,rz` (Yaskawa) and `P1=(x,y,z,a,b,c)(...)` (Mitsubishi)."""
    poses = [
        RawPose(
            f"{path}:{text.count(chr(10), 0, found.start()) + 1}",
            None,
            np.array([float(number) for number in found.groups()[1:]]),
            name=found[1],
        )
        for found in _LINE.finditer(text)
    ]
    return [Series("position list", "P", "flange", tuple(poses))] if len(poses) > 1 else []
