"""The error a calibration raises when the data cannot carry it."""

from __future__ import annotations


class CalibrationError(ValueError):
    """The data do not fix what was asked.

    Parameters
    ----------
    what:
        Which data, and what they do not fix.
    remedy:
        How to mend it.
    """

    def __init__(self, what: str, remedy: str = "") -> None:
        super().__init__(f"{what}; {remedy}" if remedy else what)
        self.what = what
        self.remedy = remedy
