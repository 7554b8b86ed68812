"""Where a calibration lies when its folder, or the recording's, is named."""

from __future__ import annotations

from pathlib import Path

from cell.errors import InputError

_NAME = "calibration.json"


def find_calibration(path: Path) -> Path | None:
    """The file itself, or the `calibration.json` in a results folder or recording, or None."""
    if not path.is_dir():
        return path
    candidates = (path / _NAME, path / "calibration" / _NAME)
    return next((c for c in candidates if c.exists()), None)


def calibration_file(path: Path) -> Path:
    """The calibration that `path` means.

    Raises
    ------
    InputError
        A folder without one.
    """
    found = find_calibration(path)
    if found is None:
        raise InputError(f"{path}: holds no {_NAME}; make one with: cell calibrate {path}")
    return found
