"""The calibrated camera in the formats of other programs."""

from cell.storage.files.calibration_source import CalibrationSource, read_calibration
from cell.verbs.export.camera import Camera
from cell.verbs.export.hand_over import FORMATS, Exported, export_calibration

__all__ = [
    "FORMATS",
    "CalibrationSource",
    "Camera",
    "Exported",
    "export_calibration",
    "read_calibration",
]
