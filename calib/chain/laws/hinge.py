"""Nothing up to some value of the covariate, a line from there on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.chain.laws.form import Form, Number, Numbers, Range, many_valued
from calib.chain.laws.step import places
from calib.views import FloatArray

_PLACES = 8


def _of(x: Sequence[FloatArray], ranges: Sequence[Range], numbers: Numbers) -> FloatArray:
    return np.maximum(ranges[0].kept(x[0]) - numbers["at"], 0.0)[:, None]


def _tried(values: Sequence[FloatArray], ranges: Sequence[Range]) -> Sequence[Numbers]:
    inner = places(values[0])
    if len(inner) > _PLACES:
        inner = inner[np.linspace(0, len(inner) - 1, _PLACES).round().astype(int)]
    return [{"at": float(at)} for at in inner]


FORM = Form(
    key="hinge",
    name="curve",
    covariates=1,
    functions=(("slope", -1),),
    numbers=(Number("at", 1, fitted=True),),
    of=_of,
    tried=_tried,
    fits=many_valued,
    terms=lambda names, ranges, numbers: [f"max(0, {names[0]} - {numbers['at']:.4g})"],
    own_constant=True,
)
