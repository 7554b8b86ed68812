"""What saturating and relaxing share: an exponential from one end of the covariate's range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.chain.laws.form import Numbers, Range
from calib.views import FloatArray

_SHARES = (0.08, 0.15, 0.3, 0.6)
"""Of the range: shorter is a step, longer a line or a parabola."""

LIKE_TIME = ("time", "order", "since_last_frame_s", "dwell_s", "dwell", "settle_s")


def like_time(name: str) -> bool:
    """Whether the covariate of that name is a time, by which things relax."""
    return name in LIKE_TIME or "since" in name or "dwell" in name or "settle" in name


def decay(x: FloatArray, seen: Range, numbers: Numbers) -> FloatArray:
    """(N,) from one at the start of the range towards zero."""
    way = np.maximum(x - seen.low, 0.0) if numbers["from_end"] == 0.0 else seen.high - x
    return np.asarray(np.exp(-np.maximum(way, 0.0) / max(numbers["constant"], 1e-9)))


def from_low(values: Sequence[FloatArray], ranges: Sequence[Range]) -> Sequence[Numbers]:
    """Constants to try, from the range's start."""
    return [{"constant": s * ranges[0].width, "from_end": 0.0} for s in _SHARES]


def from_both(values: Sequence[FloatArray], ranges: Sequence[Range]) -> Sequence[Numbers]:
    """Constants to try, from either end."""
    return [
        {"constant": s * ranges[0].width, "from_end": end} for s in _SHARES for end in (0.0, 1.0)
    ]


def terms(names: Sequence[str], ranges: Sequence[Range], numbers: Numbers) -> str:
    """The exponential in symbols."""
    constant = f"{numbers['constant']:.4g}"
    if numbers["from_end"]:
        return f"exp(-({ranges[0].high:.4g} - {names[0]}) / {constant})"
    return f"exp(-({names[0]} - {ranges[0].low:.4g}) / {constant})"
