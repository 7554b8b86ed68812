"""Along a parabola of the covariate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.chain.laws.form import Form, Numbers, Range, many_valued, nothing_to_try
from calib.views import FloatArray


def _of(x: Sequence[FloatArray], ranges: Sequence[Range], numbers: Numbers) -> FloatArray:
    off = ranges[0].kept(x[0]) - ranges[0].middle
    return np.stack([off, off * off], axis=1)


FORM = Form(
    key="quadratic",
    name="quadratic",
    covariates=1,
    functions=(("slope", -1), ("curvature", -2)),
    numbers=(),
    of=_of,
    tried=nothing_to_try,
    fits=lambda name, value: many_valued(name, value) and name not in ("time", "order"),
    terms=lambda names, ranges, numbers: [
        f"({names[0]} - {ranges[0].middle:.4g})",
        f"({names[0]} - {ranges[0].middle:.4g})^2",
    ],
    own_constant=True,
)
