"""Where a calibration lies when its folder, or the recording's, is named."""

from __future__ import annotations

from pathlib import Path

from cell.errors import InputError

_NAME = "calibration.json"


def calibration_file(path: Path) -> Path:
    """The file itself, or the `calibration.json` in a results folder or a recording.

    Raises
    ------
    InputError
        A folder without one.
    """
    if not path.is_dir():
        return path
    for candidate in (path / _NAME, path / "calibration" / _NAME):
        if candidate.exists():
            return candidate
    raise InputError(f"{path}: holds no {_NAME}; make one with: cell calibrate {path}")
