"""Dying away with time, or with the time since a move."""

from __future__ import annotations

from calib.chain.laws.exponential import decay, from_low, like_time, terms
from calib.chain.laws.form import Form, Number, many_valued

FORM = Form(
    key="relaxation",
    name="relaxation",
    covariates=1,
    functions=(("start", 0),),
    numbers=(Number("constant", 1, fitted=True), Number("from_end", 0, fitted=False)),
    of=lambda x, ranges, numbers: decay(x[0], ranges[0], numbers)[:, None],
    tried=from_low,
    fits=lambda name, value: many_valued(name, value) and like_time(name),
    terms=lambda names, ranges, numbers: [terms(names, ranges, numbers)],
    own_constant=True,
)
