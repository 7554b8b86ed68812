"""A whole calibration: every solution the views allow, side by side, and what they are worth."""

from calib.calibration.pipeline import calibrate
from calib.calibration.result import (
    Calibration,
    PositionError,
    Rejection,
    RobotReference,
    Solution,
    Statistics,
)

__all__ = [
    "Calibration",
    "PositionError",
    "Rejection",
    "RobotReference",
    "Solution",
    "Statistics",
    "calibrate",
]
