"""The calibrated camera in the formats of other programs."""

from cell.export.camera import Camera
from cell.export.hand_over import FORMATS, Exported, export_calibration
from cell.export.reading import CalibrationSource, read_calibration

__all__ = [
    "FORMATS",
    "CalibrationSource",
    "Camera",
    "Exported",
    "export_calibration",
    "read_calibration",
]
