"""One value up to some value of the covariate, another from there on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.chain.laws.form import Form, Number, Numbers, Range
from calib.views import FloatArray

_FEWEST_ON_ONE_SIDE = 3
_MOST_PLACES = 24


def places(value: FloatArray) -> FloatArray:
    """Values from which on a step can begin, with enough frames on both sides."""
    known = np.sort(value[np.isfinite(value)])
    inner = np.unique(known)[1:]
    below = np.searchsorted(known, inner)
    fewest = np.minimum(below, len(known) - below)
    inner = inner[fewest >= _FEWEST_ON_ONE_SIDE]
    if len(inner) > _MOST_PLACES:
        inner = inner[np.linspace(0, len(inner) - 1, _MOST_PLACES).round().astype(int)]
    return np.asarray(inner)


def _tried(values: Sequence[FloatArray], ranges: Sequence[Range]) -> Sequence[Numbers]:
    return [{"at": float(at)} for at in places(values[0])]


FORM = Form(
    key="step",
    name="step",
    covariates=1,
    functions=(("step", 0),),
    numbers=(Number("at", 1, fitted=False),),
    of=lambda x, ranges, numbers: (x[0] >= numbers["at"]).astype(np.float64)[:, None],
    tried=_tried,
    fits=lambda name, value: "approach" not in name and "side" not in name,
    terms=lambda names, ranges, numbers: [f"[{names[0]} >= {numbers['at']:.4g}]"],
)
