"""Turns images and poses of another tool's layout into a recording."""

from typing import Literal

RotationName = Literal[
    "matrix",
    "matrix_by_columns",
    "quat_xyzw",
    "quat_wxyz",
    "rotvec",
    "rotvec_deg",
    "rpy",
    "rpy_deg",
    "euler_zyx",
    "euler_zyx_deg",
    "euler_xyz",
    "euler_xyz_deg",
    "euler_zyz",
    "euler_zyz_deg",
]
Unit = Literal["m", "mm", "cm", "in"]
Take = Literal["still", "moving", "all"]
"""Which pictures of a ROS bag."""
