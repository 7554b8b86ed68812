"""From data to the page: limits, and linear or logarithmic scales with ticks one can read."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.views import FloatArray

MARGIN = 0.05
"""Room left around the data, as a share of their range."""
_STEPS = (1.0, 2.0, 5.0, 10.0)
_LOG_SUBS = (1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Scale:
    """One axis: its limits (low may be above high: turned round), and whether logarithmic."""

    low: float
    high: float
    log: bool = False

    def share(self, value: ArrayLike) -> FloatArray:
        """Where values lie between the limits, as a share; infinite ones at the nearest limit."""
        at, low, high = np.asarray(value, dtype=np.float64), self.low, self.high
        with np.errstate(invalid="ignore", divide="ignore"):
            if self.log:
                at, low, high = np.log10(at), math.log10(low), math.log10(high)
            share = np.asarray((at - low) / (high - low))
        return np.where(np.isinf(at), np.clip(share, 0.0, 1.0), share)

    def ticks(self, count: float) -> list[float]:
        """About `count` round values between the limits."""
        low, high = sorted((self.low, self.high))
        if self.log:
            return _log_ticks(low, high)
        step = _round_step((high - low) / max(count, 1.0))
        first = math.ceil(low / step - 1e-9)
        last = math.floor(high / step + 1e-9)
        return [step * k for k in range(first, last + 1)]

    def labels(self, ticks: list[float]) -> list[str]:
        """What is written beside the ticks, all with as many decimals as they need."""
        if self.log or len(ticks) < 2:
            return [signed(f"{tick:g}") for tick in ticks]
        step = abs(ticks[1] - ticks[0])
        decimals = max(0, -math.floor(math.log10(step) + 1e-9))
        if decimals > 5 or step >= 1e6:
            return [signed(f"{tick:.3g}") for tick in ticks]
        return [signed(f"{tick + 0.0:.{decimals}f}") for tick in ticks]


def signed(number: str) -> str:
    """A number with a true minus sign, and zero without one."""
    return number.replace("-", "−") if float(number) != 0.0 else number.lstrip("-")


def _round_step(step: float) -> float:
    power = 10.0 ** math.floor(math.log10(step)) if step > 0.0 else 1.0
    return power * next((s for s in _STEPS if s * power >= step * (1 - 1e-9)), 10.0)


def _log_ticks(low: float, high: float) -> list[float]:
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    subs = _LOG_SUBS if len(decades) <= 4 else (1.0,)
    return [s * 10.0**d for d in decades for s in subs if low <= s * 10.0**d <= high]


def scale_of(values: FloatArray, log: bool = False) -> Scale:
    """A scale that shows all finite values with a little room around them."""
    shown = values[np.isfinite(values) & ((values > 0.0) | (not log))]
    if not len(shown):
        return Scale(0.1, 1.0, log=True) if log else Scale(0.0, 1.0)
    low, high = float(shown.min()), float(shown.max())
    if log:
        room = (high / low) ** MARGIN if high > low else 2.0
        return Scale(low / room, high * room, log=True)
    room = MARGIN * (high - low) if high > low else max(0.05 * abs(high), 1e-9)
    return Scale(low - room, high + room)


@dataclass(frozen=True)
class Place:
    """A box on the page, in points from its own top left corner, and the two scales in it."""

    x: Scale
    y: Scale
    width: float
    height: float

    def at(self, x: ArrayLike, y: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Page coordinates of data."""
        return self.x.share(x) * self.width, (1.0 - self.y.share(y)) * self.height
