"""What a log says under keys that the program does not know: numbers and words, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.views import FloatArray
from cell.storage.incoming.limits import JOINTS

_WORDS = ("station",)
"""Keys whose numbers are names, too."""


def additional_numbers(lines: Sequence[Mapping[str, Any]]) -> dict[str, FloatArray]:
    """(N,) of every number by its key, NaN where a frame has none.

    The numbers of a list count one by one, from 1: `current_a: [1.0, 2.0]` makes `current_a_1`
    and `current_a_2`.
    """
    columns: dict[str, FloatArray] = {}
    for index, line in enumerate(lines):
        for name, number in _numbers(line):
            column = columns.setdefault(name, np.full(len(lines), np.nan))
            column[index] = number
    return columns


def _numbers(line: Mapping[str, Any]) -> list[tuple[str, float]]:
    found: list[tuple[str, float]] = []
    for key, value in line.items():
        if key in _WORDS:
            continue
        listed = isinstance(value, (list, tuple))
        if listed and len(value) > JOINTS:
            continue  # no covariate: a curve, a picture
        for at, number in enumerate(value if listed else (value,), start=1):
            if isinstance(number, (int, float)) and math.isfinite(number):
                found.append((f"{key}_{at}" if listed else key, float(number)))
    return found


def additional_labels(lines: Sequence[Mapping[str, Any]]) -> dict[str, NDArray[np.str_]]:
    """(N,) of every word by its key, empty where a frame has none."""
    keys = dict.fromkeys(k for line in lines for k, v in line.items() if _is_word(k, v))
    return {
        key: np.array([str(line[key]) if _is_word(key, line.get(key)) else "" for line in lines])
        for key in keys
    }


def _is_word(key: str, value: object) -> bool:
    return isinstance(value, str) or (key in _WORDS and isinstance(value, int))
