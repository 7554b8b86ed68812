"""Calibration core: the measurement chain, the fits that evaluate it, and the discovery.

Imports no other package of ours; knows no file, no device and no terminal.

For those who bring their own corners::

    from calib import Board, Views, calibrate, diagnose

    board = Board("chessboard", rows=7, cols=10, square_m=0.025)
    size = (4096, 3072)
    views = Views.from_corners(board, corners, image_size_px=size, base_from_flange=poses)
    found = calibrate(views)
    print(found.solutions["joint_ml"].values, found.focus_law)
    print(diagnose(views).verdict)

Names are loaded when they are first used: importing `calib` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calib.calibration.mapping import as_mapping
    from calib.calibration.pipeline import calibrate
    from calib.calibration.result import Calibration, Solution
    from calib.chain.model import CellModel, predict
    from calib.chain.optics import OPTICS, optics_row
    from calib.chain.sight import project, unproject
    from calib.detection import Detection, Rejected, detect
    from calib.discovery.diagnose import diagnose
    from calib.discovery.diagnosis import Diagnosis
    from calib.errors import CalibrationError
    from calib.views import Board, Views

__all__ = [
    "OPTICS",
    "Board",
    "Calibration",
    "CalibrationError",
    "CellModel",
    "Detection",
    "Diagnosis",
    "Rejected",
    "Solution",
    "Views",
    "as_mapping",
    "calibrate",
    "detect",
    "diagnose",
    "optics_row",
    "predict",
    "project",
    "unproject",
]

_HOME = {
    "OPTICS": "calib.chain.optics",
    "Board": "calib.views",
    "Calibration": "calib.calibration.result",
    "CalibrationError": "calib.errors",
    "CellModel": "calib.chain.model",
    "Detection": "calib.detection",
    "Diagnosis": "calib.discovery.diagnosis",
    "Rejected": "calib.detection",
    "Solution": "calib.calibration.result",
    "Views": "calib.views",
    "as_mapping": "calib.calibration.mapping",
    "calibrate": "calib.calibration.pipeline",
    "detect": "calib.detection",
    "diagnose": "calib.discovery.diagnose",
    "optics_row": "calib.chain.optics",
    "predict": "calib.chain.model",
    "project": "calib.chain.sight",
    "unproject": "calib.chain.sight",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("calibration-cell")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
