"""In proportion to the covariate."""

from __future__ import annotations

from calib.chain.laws.form import Form, many_valued, nothing_to_try

FORM = Form(
    key="linear",
    name="linear",
    covariates=1,
    functions=(("slope", -1),),
    numbers=(),
    of=lambda x, ranges, numbers: (ranges[0].kept(x[0]) - ranges[0].middle)[:, None],
    tried=nothing_to_try,
    fits=many_valued,
    terms=lambda names, ranges, numbers: [f"({names[0]} - {ranges[0].middle:.4g})"],
    own_constant=True,
)
