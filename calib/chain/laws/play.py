"""One way or the other by the side from which a joint came, or on which its load lies."""

from __future__ import annotations

from calib.chain.laws.form import Form, nothing_to_try

FORM = Form(
    key="play",
    name="play",
    covariates=1,
    functions=(("play", 0),),
    numbers=(),
    of=lambda x, ranges, numbers: x[0][:, None],
    tried=nothing_to_try,
    fits=lambda name, value: "approach" in name or "side" in name,
    terms=lambda names, ranges, numbers: [names[0]],
)
