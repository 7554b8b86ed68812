"""What a form of a law is: how a site of the chain follows one covariate, or two."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib.views import FloatArray

BEYOND = 0.2
"""A covariate counts this share of its range beyond what was seen, and no further."""


@dataclass(frozen=True)
class Range:
    """What was seen of a covariate."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """Half way between the lowest and the highest."""
        return 0.5 * (self.low + self.high)

    @property
    def width(self) -> float:
        """From the lowest to the highest."""
        return max(self.high - self.low, 1e-12)

    def kept(self, value: FloatArray) -> FloatArray:
        """The values, none of them far beyond what was seen."""
        room = BEYOND * self.width
        return np.clip(value, self.low - room, self.high + room)


Numbers = Mapping[str, float]
"""Shapes and settings of a form by name."""

Functions = Callable[[Sequence[FloatArray], Sequence[Range], Numbers], FloatArray]
"""(N, B) of the B functions, from the covariates' (N,) values, their ranges, and the numbers."""


@dataclass(frozen=True)
class Number:
    """A number of a form that is no amount.

    Attributes
    ----------
    name:
        In files and in reports.
    power:
        Its unit is the covariate's to this power.
    fitted:
        Whether it is fitted once the amounts are not zero; else it is given (the place of a step).
    """

    name: str
    power: int
    fitted: bool


@dataclass(frozen=True)
class Form:
    """One way in which a site can follow covariates.

    Attributes
    ----------
    key:
        Unique, as it stands in files.
    name:
        As reports name it (the contract's `form`).
    covariates:
        How many it takes.
    functions:
        Name of each function, and the power of the covariate in its unit.
    numbers:
        Its shapes and settings.
    of:
        Works out the functions.
    tried:
        Sets of numbers worth trying, given the covariates' values and ranges.
    fits:
        Whether the form makes sense for a covariate of that name, with these values.
    terms:
        The equation, from the names of the covariates, their ranges and the numbers: one term
        for each function.
    own_constant:
        Whether the form begins anywhere: a joint between the first and the last then needs a
        constant of its own, which neither mount nor board absorbs.
    """

    key: str
    name: str
    covariates: int
    functions: tuple[tuple[str, int], ...]
    numbers: tuple[Number, ...]
    of: Functions
    tried: Callable[[Sequence[FloatArray], Sequence[Range]], Sequence[Numbers]]
    fits: Callable[[str, FloatArray], bool]
    terms: Callable[[Sequence[str], Sequence[Range], Numbers], Sequence[str]]
    own_constant: bool = False


def nothing_to_try(values: Sequence[FloatArray], ranges: Sequence[Range]) -> Sequence[Numbers]:
    """One try, for a form without numbers."""
    return ({},)


TWO_VALUES = 2


def many_valued(name: str, value: FloatArray) -> bool:
    """Whether the covariate takes more than two values: a line through two says nothing more."""
    return len(np.unique(value[np.isfinite(value)])) > TWO_VALUES
