"""Numbers as a reader wants them: as many digits as the uncertainty allows, and a unit."""

from __future__ import annotations

import math

UNKNOWN = "not known"

_SMALLER = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "s": ("ms", 1e3)}
NAMES = {
    "zhang_algebraic": "Zhang, algebraic",
    "zhang_mle": "Zhang, maximum likelihood",
    "fixed_alpha_algebraic": "fixed α, algebraic",
    "fixed_alpha_mle": "fixed α, maximum likelihood",
    "joint_ml": "joint fit with the robot",
}
SYMBOLS = {
    "alpha_px": "α",
    "beta_px": "β",
    "u0_px": "u₀",
    "v0_px": "v₀",
    "skew_px": "γ",
    "k1": "k₁",
    "k2": "k₂",
    "alpha0_px": "α₀",
    "k_px_m2": "k",
    "alpha_inf_px": "α∞",
    "f_m": "f",
}


def known(value: object) -> bool:
    """Whether `value` is a finite number."""
    return isinstance(value, int | float) and math.isfinite(value)


def solution_name(key: str) -> str:
    """A solution's key in words."""
    return NAMES.get(key, key.replace("_", " "))


def symbol(key: str) -> str:
    """A parameter's key as its symbol, or readable."""
    return SYMBOLS.get(key, key.replace("_", " "))


def number(value: float | None, unit: str = "", digits: int = 3) -> str:
    """`value` to `digits` significant digits, with its unit."""
    if value is None or not known(value):
        return UNKNOWN
    return _join(_fixed(value, _decimals(value, digits)), unit)


def measured(value: float | None, sigma: float | None, unit: str = "") -> str:
    """Value ± one sigma, both to two digits of sigma; says so where sigma is unknown."""
    if value is None or not known(value):
        return UNKNOWN
    value, sigma, unit = _readable(value, sigma, unit)
    if sigma is None or not known(sigma) or sigma <= 0:
        return f"{number(value, unit, 5)} (± not known)"
    decimals = _decimals(sigma, 2)
    if max(abs(value), sigma) < 1e-3:
        return _scientific(value, sigma, unit)
    return _join(f"{_fixed(value, decimals)} ± {_fixed(sigma, decimals)}", unit)


def millimetres(value_m: float | None, digits: int = 2) -> str:
    """A length in metres, shown in millimetres."""
    return number(None if value_m is None else value_m * 1e3, "mm", digits)


def _readable(value: float, sigma: float | None, unit: str) -> tuple[float, float | None, str]:
    if unit not in _SMALLER or abs(value) >= 1.0:
        return value, sigma, unit
    smaller, factor = _SMALLER[unit]
    return value * factor, None if sigma is None else sigma * factor, smaller


def _decimals(value: float, digits: int) -> int:
    if value == 0 or not math.isfinite(value):
        return 0
    return digits - 1 - math.floor(math.log10(abs(value)))


def _fixed(value: float, decimals: int) -> str:
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    return text.replace("-", "−") if float(text) != 0 else text.lstrip("-")


def _scientific(value: float, sigma: float, unit: str) -> str:
    power = math.floor(math.log10(max(abs(value), sigma)))
    scale = 10.0**power
    decimals = max(_decimals(sigma / scale, 2), 0)
    pair = f"({_fixed(value / scale, decimals)} ± {_fixed(sigma / scale, decimals)})"
    return _join(f"{pair}·10{_superscript(power)}", unit)


def _superscript(power: int) -> str:
    return str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _join(text: str, unit: str) -> str:
    return f"{text} {unit}".rstrip()
