"""Turns images and poses of another tool's layout into a recording."""

from typing import Literal

RotationName = Literal[
    "matrix", "quat_xyzw", "quat_wxyz", "rotvec", "rotvec_deg", "rpy", "rpy_deg", "euler_zyx_deg"
]
Unit = Literal["m", "mm"]
