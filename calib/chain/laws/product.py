"""In proportion to the product of two covariates."""

from __future__ import annotations

from calib.chain.laws.form import Form, many_valued, nothing_to_try

FORM = Form(
    key="product",
    name="product",
    covariates=2,
    functions=(("product", -1),),
    numbers=(),
    of=lambda x, ranges, numbers: (ranges[0].kept(x[0]) * ranges[1].kept(x[1]))[:, None],
    tried=nothing_to_try,
    fits=many_valued,
    words=lambda names, ranges, numbers: [f"{names[0]} * {names[1]}"],
    own_constant=True,
)
