"""Tails and quantiles of the test statistics' distributions, from scipy's special functions.

`scipy.stats` has the same numbers, but importing it takes more than half a second and 25 MB, which
is more than many a fit takes.
"""

from __future__ import annotations

from scipy.special import bdtrc, chdtrc, chdtri, chndtrinc, fdtrc, ndtr, ndtri


def chi2_tail(value: float, freedom: float) -> float:
    """Probability that a chi-square of `freedom` degrees is larger than `value`."""
    return float(chdtrc(freedom, max(value, 0.0)))


def chi2_limit(tail: float, freedom: float) -> float:
    """The value that a chi-square of `freedom` degrees exceeds with probability `tail`."""
    return float(chdtri(freedom, tail))


def binomial_tail(count: int, trials: int, share: float) -> float:
    """Probability that more than `count` of so many trials hit, each with probability `share`."""
    return float(bdtrc(count, trials, share)) if count >= 0 else 1.0


def f_tail(value: float, columns: float, freedom: float) -> float:
    """Probability that an F of `columns` and `freedom` degrees is larger than `value`."""
    return float(fdtrc(columns, freedom, max(value, 0.0)))


def normal_tail(value: float) -> float:
    """Probability that a standard normal number is larger than `value`."""
    return float(ndtr(-value))


def normal_limit(tail: float) -> float:
    """The value that a standard normal number exceeds with probability `tail`."""
    return float(-ndtri(tail))


def noncentrality(freedom: float, false_alarm: float, detection: float) -> float:
    """Noncentrality at which a chi-square test detects with probability `detection`.

    The test has `freedom` degrees and gives a false alarm with probability `false_alarm`.
    """
    return float(chndtrinc(chi2_limit(false_alarm, freedom), freedom, 1.0 - detection))
