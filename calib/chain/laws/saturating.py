"""Rising with the covariate, less and less."""

from __future__ import annotations

from calib.chain.laws.exponential import decay, from_both, like_time, terms
from calib.chain.laws.form import Form, Number, many_valued

FORM = Form(
    key="saturating",
    name="saturating",
    covariates=1,
    functions=(("rise", 0),),
    numbers=(Number("constant", 1, fitted=True), Number("from_end", 0, fitted=False)),
    of=lambda x, ranges, numbers: (1.0 - decay(x[0], ranges[0], numbers))[:, None],
    tried=from_both,
    fits=lambda name, value: many_valued(name, value) and not like_time(name),
    terms=lambda names, ranges, numbers: [f"(1 - {terms(names, ranges, numbers)})"],
    own_constant=True,
)
