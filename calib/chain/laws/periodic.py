"""Swinging with the covariate: a gear's or an encoder's error, a base that sways, a focus drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.chain.laws.form import Form, Number, Numbers, Range
from calib.views import FloatArray

MOST_CYCLES = 330
"""Cycles a turn: a strain-wave gear of ratio 160 makes two waves a turn of its input (320)."""

_TIME_STEPS = 240

_FOCUS = ("inverse_distance", "focus_position")
"""A focus drive's lead screw turns with these."""


def _of(x: Sequence[FloatArray], ranges: Sequence[Range], numbers: Numbers) -> FloatArray:
    phase = numbers["cycles"] * x[0]
    return np.stack([np.sin(phase), np.cos(phase)], axis=1)


def _tried(values: Sequence[FloatArray], ranges: Sequence[Range]) -> Sequence[Numbers]:
    """Every whole number of cycles of an angle; of anything else what its spacing shows."""
    value = values[0]
    if ranges[0].low >= -2.0 * np.pi and ranges[0].high <= 2.0 * np.pi:
        return [{"cycles": float(n)} for n in range(1, MOST_CYCLES + 1)]
    step = float(np.median(np.diff(np.sort(value[np.isfinite(value)]))))
    longest, shortest = 0.5 * ranges[0].width, max(0.5 * step, 0.2)
    frequency = np.linspace(1.0 / longest, 1.0 / shortest, _TIME_STEPS)
    return [{"cycles": float(c)} for c in 2.0 * np.pi * frequency]


def _terms(names: Sequence[str], ranges: Sequence[Range], numbers: Numbers) -> Sequence[str]:
    cycles = numbers["cycles"]
    return [f"sin({cycles:.5g} {names[0]})", f"cos({cycles:.5g} {names[0]})"]


FORM = Form(
    key="periodic",
    name="periodic",
    covariates=1,
    functions=(("sin", 0), ("cos", 0)),
    numbers=(Number("cycles", -1, fitted=True),),
    of=_of,
    tried=_tried,
    fits=lambda name, value: name == "time" or name in _FOCUS or name.startswith("joint_"),
    terms=_terms,
)
