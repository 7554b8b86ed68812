"""The error a calibration raises when the data cannot carry it."""

from __future__ import annotations


class CalibrationError(ValueError):
    """The data do not fix what was asked; the message says which data and how to mend it."""
