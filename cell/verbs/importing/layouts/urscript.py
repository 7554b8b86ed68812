"""URScript: every `p[x, y, z, rx, ry, rz]`, and the joint angles of `movej([...])`."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cell.verbs.importing.raw import RawPose, Role, Series

_N = r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*"
_SIX = ",".join([_N] * 6)
_POSE = re.compile(rf"(?:([A-Za-z_]\w*)\s*=\s*)?(?<!\w)p\[{_SIX}\]")
_JOINTS = re.compile(rf"(?:([A-Za-z_]\w*)\s*=\s*)?(?<![\w\]])\[{_SIX}\]")


def read(path: Path, text: str) -> list[Series]:
    """Poses in metres with rotation vectors; joint angles in radians, where there are any."""
    if not re.search(r"\bp\[|\bmove[jlp]\s*\(|\bset_(?:tcp|payload)\b", text):
        return []
    poses = _found(path, text, _POSE, "p[...]", "flange")
    joints = _found(path, text, _JOINTS, "movej joints", "joints")
    return [series for series in (poses, joints) if series.poses]


def _found(path: Path, text: str, pattern: re.Pattern[str], key: str, role: Role) -> Series:
    poses = [
        RawPose(
            f"{path}:{line}",
            None,
            np.array([float(number) for number in found.groups()[1:]]),
            ("rotvec",) if role == "flange" else (),
            "m" if role == "flange" else None,
            name=found[1],
        )
        for line, content in enumerate(text.splitlines(), 1)
        for found in pattern.finditer(content.partition("#")[0])
    ]
    notes = ("a UR pose is the tool's: it is the flange's where the TCP was set to zero",)
    return Series("URScript", key, role, tuple(poses), notes if role == "flange" else ())
