"""What `cell compare` may be given: a calibration, a folder that holds one, or a recording."""

from __future__ import annotations

from pathlib import Path

from cell.storage.files.calibration_place import find_calibration
from cell.storage.files.calibration_source import CalibrationSource, read_calibration


def source_of(path: Path) -> CalibrationSource:
    """The calibration that `path` means; a recording without one is calibrated, nothing written.

    Raises
    ------
    InputError
        There is neither.
    BadAnswer
        The recording cannot be calibrated.
    """
    found = find_calibration(path)
    if found is not None:
        return read_calibration(found)
    from cell.storage.recording import read_recording
    from cell.verbs.calibrate import calibrate_recording

    calibrated = calibrate_recording(read_recording(path))
    return CalibrationSource.model_validate(calibrated.mapping)
