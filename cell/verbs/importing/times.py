"""Times as log files write them: seconds, or milli-, micro- and nanoseconds since an epoch."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

_NAMES = ("time", "%time", "timestamp", "t", "t_s", "stamp", "time_s", "header.stamp", "secs")


def time_in(data: Mapping[str, Any], time_s: float | None) -> float | None:
    """The time that a mapping says, as its message's header or under its own name."""
    header = data.get("header")
    if isinstance(header, Mapping):
        time_s = time_in(header, time_s)
    stamp = data.get("stamp")
    if isinstance(stamp, Mapping):
        return _stamp(stamp, time_s)
    lower = {_plain(str(key)): value for key, value in data.items()}
    for name in _NAMES:
        value = lower.get(name)
        if isinstance(value, int | float) and not isinstance(value, bool):
            return seconds(value)
    return time_s


def _plain(name: str) -> str:
    return re.sub(r"^(?:field\.)|\s*[\[(](?:s|ns|ms|us)[\])]$", "", name.strip().lower())


def _stamp(stamp: Mapping[str, Any], time_s: float | None) -> float | None:
    whole = stamp.get("secs", stamp.get("sec"))
    part = stamp.get("nsecs", stamp.get("nanosec", stamp.get("nsec", 0)))
    if isinstance(whole, int | float) and isinstance(part, int | float):
        return float(whole) + 1e-9 * float(part)
    return time_s


def seconds(value: float) -> float:
    """A time as seconds: counts of this century say by their size what they count."""
    size = abs(value)
    for above, scale in ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3)):
        if size > above:
            return float(value) * scale
    return float(value)
