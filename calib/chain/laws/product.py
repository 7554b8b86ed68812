"""In proportion to the product of two covariates."""

from __future__ import annotations

import numpy as np

from calib.chain.laws.form import Form, many_valued, nothing_to_try
from calib.views import FloatArray

_VARIES = 0.5


def _fits(name: str, value: FloatArray) -> bool:
    """Whether the covariate varies by half of itself: times a constant is no product."""
    known = value[np.isfinite(value)]
    return many_valued(name, value) and float(np.ptp(known)) > _VARIES * np.abs(known).max()


FORM = Form(
    key="product",
    name="product",
    covariates=2,
    functions=(("product", -1),),
    numbers=(),
    of=lambda x, ranges, numbers: (ranges[0].kept(x[0]) * ranges[1].kept(x[1]))[:, None],
    tried=nothing_to_try,
    fits=_fits,
    terms=lambda names, ranges, numbers: [f"{names[0]} * {names[1]}"],
    own_constant=True,
)
