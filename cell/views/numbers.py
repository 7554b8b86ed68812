"""Numbers as a reader wants them: as many digits as the uncertainty allows, and a unit."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, TypeGuard

UNKNOWN = "not known"

_SMALL = 1e-3
_SUFFIX = re.compile(r"_?(rad_per_Nm|rad_per_g|px_per_g|m_rad2|px_m2|px|rad|m|s)?(?:_(\d))?$")
_SMALLER = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "s": ("ms", 1e3)}
NAMES = {
    "zhang_algebraic": "Zhang, algebraic",
    "zhang_mle": "Zhang, maximum likelihood",
    "zhang_mle_no_skew": "Zhang, maximum likelihood, no skew",
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
    "p1": "p₁",
    "p2": "p₂",
    "k3": "k₃",
    "k4": "k₄",
    "k5": "k₅",
    "k6": "k₆",
    "s1": "s₁",
    "s2": "s₂",
    "s3": "s₃",
    "s4": "s₄",
    "tilt_x_rad": "τx",
    "tilt_y_rad": "τy",
    "alpha0_px": "α₀",
    "k_px_m2": "k",
    "alpha_inf_px": "α∞",
    "f_m": "f",
}


def known(value: object) -> TypeGuard[float]:
    """Whether `value` is a finite number."""
    return isinstance(value, int | float) and math.isfinite(value)


def solution_name(key: str) -> str:
    """A solution's key in words."""
    return NAMES.get(key, key.replace("_", " "))


def symbol(key: str) -> str:
    """A parameter's key as its symbol, or in words without its unit."""
    if key in SYMBOLS:
        return SYMBOLS[key]
    match = _SUFFIX.search(key)
    stem = key[: match.start()] if match else key
    joint = f"joint {match.group(2)}" if match and match.group(2) else ""
    return ", ".join(part for part in (stem.replace("_", " "), joint) if part) or "size"


def number(value: float | None, unit: str = "", digits: int = 3) -> str:
    """`value` to `digits` significant digits, with its unit."""
    if not known(value):
        return UNKNOWN
    if 0 < abs(value) < _SMALL:
        return _join(_power(value, digits), unit)
    return _join(_fixed(value, _decimals(value, digits)), unit)


def measured(value: float | None, sigma: float | None, unit: str = "") -> str:
    """Value ± one sigma, both to two digits of sigma; says so where sigma is unknown."""
    if not known(value):
        return UNKNOWN
    value, sigma, unit = _readable(value, sigma, unit)
    if sigma == 0:  # a choice, such as a frame's number, not a measurement
        return _join(f"{value:g}", unit)
    if not known(sigma):
        return f"{number(value, unit, 5)} (± not known)"
    return _join(plus_minus(value, sigma), unit)


def plus_minus(value: float | None, sigma: float | None) -> str:
    """Value ± sigma without unit, for a table that names it; alone where sigma is unknown."""
    if not known(value) or not known(sigma) or sigma <= 0:
        return number(value, "", 5)
    if max(abs(value), sigma) < _SMALL:
        return _scientific(value, sigma)
    decimals = _decimals(sigma, 2)
    return f"{_fixed(value, decimals)} ± {_fixed(sigma, decimals)}"


def parameters(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Named values with their uncertainties, in one line."""
    return "; ".join(
        f"{symbol(name)} = {measured(entry['value'], entry.get('sigma'), entry.get('unit', ''))}"
        for name, entry in found.items()
    )


def probability(p: float | None) -> str:
    """A p-value with its sign of relation."""
    if not known(p):
        return UNKNOWN
    return "< 10⁻⁹" if p < 1e-9 else f"= {number(p, '', 2)}"


def millimetres(value_m: float | None, digits: int = 2) -> str:
    """A length in metres, shown in millimetres."""
    return number(None if value_m is None else value_m * 1e3, "mm", digits)


def _readable(value: float, sigma: float | None, unit: str) -> tuple[float, float | None, str]:
    exact = known(sigma) and 0 < sigma < _SMALL
    if unit not in _SMALLER or (abs(value) >= 1.0 and not exact):
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


def _power(value: float, digits: int) -> str:
    power = math.floor(math.log10(abs(value)))
    return f"{_fixed(value / 10.0**power, digits - 1)}·10{_superscript(power)}"


def _scientific(value: float, sigma: float) -> str:
    power = math.floor(math.log10(max(abs(value), sigma)))
    scale = 10.0**power
    decimals = max(_decimals(sigma / scale, 2), 0)
    pair = f"({_fixed(value / scale, decimals)} ± {_fixed(sigma / scale, decimals)})"
    return f"{pair}·10{_superscript(power)}"


def _superscript(power: int) -> str:
    return str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _join(text: str, unit: str) -> str:
    pretty = unit.replace("^2", "²").replace(" m", "·m")
    if unit in ("", "1"):
        return text
    return f"{text}°" if unit == "°" else f"{text} {pretty}"
