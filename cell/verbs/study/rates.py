"""Shares of runs, with how well so many runs can know them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def rate(hits: Sequence[bool]) -> dict[str, Any]:
    """How many of how many, and the exact 95 % interval (Clopper and Pearson 1934)."""
    if not hits:
        return {"hits": 0, "runs": 0, "share": None, "low": None, "high": None}
    count, runs = sum(hits), len(hits)
    from scipy.stats import binomtest  # a second's import, for studies only

    ends = binomtest(count, runs).proportion_ci(0.95)
    return {
        "hits": count,
        "runs": runs,
        "share": count / runs,
        "low": float(ends.low),
        "high": float(ends.high),
    }


def as_percent(rate: dict[str, Any]) -> str:
    """A rate for people: the share, and its interval."""
    if not rate["runs"]:
        return "-"
    share, low, high = (100 * rate[key] for key in ("share", "low", "high"))
    return f"{share:.0f} % ({low:.0f} to {high:.0f})"
