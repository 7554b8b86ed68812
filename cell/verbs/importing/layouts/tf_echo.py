"""What `tf_echo` of ROS and ROS 2 prints: translation and quaternion at a time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from cell.verbs.importing.raw import RawPose, Series

_N = r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*"
_BLOCK = re.compile(
    rf"(?:At time\s+([\d.]+)\s+)?-\s*Translation:\s*\[{_N},{_N},{_N}\]"
    rf"\s*-\s*Rotation:\s*in Quaternion\s*(?:\(xyzw\)\s*)?\[{_N},{_N},{_N},{_N}\]"
)


def read(path: Path, text: str) -> list[Series]:
    """The transforms in their order: metres, scalar last."""
    poses = []
    for found in _BLOCK.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        values = np.array([float(number) for number in found.groups()[1:]])
        time = None if found[1] is None else float(found[1])
        poses.append(RawPose(f"{path}:{line}", None, values, ("quat_xyzw",), "m", time_s=time))
    return [Series("tf_echo", "transform", "flange", tuple(poses))] if poses else []
