"""Numbers carry the digits their uncertainty allows, and a unit."""

from __future__ import annotations

import math

import pytest

from cell.views.numbers import measured, number, plus_minus, probability, symbol


@pytest.mark.parametrize(
    ("value", "sigma", "unit", "shown"),
    [
        (1370.83412, 0.2184, "px", "1370.83 ± 0.22 px"),
        (0.0123456, 1.1e-5, "m", "12.346 ± 0.011 mm"),
        (2.13456, 0.012, "m", "2.135 ± 0.012 m"),
        (1.2000014, 3.3e-6, "m", "1200.0014 ± 0.0033 mm"),
        (-0.002, 3e-4, "rad", "−2.00 ± 0.30 mrad"),
        (2.1e-5, 2e-6, "rad/Nm", "(2.10 ± 0.20)·10⁻⁵ rad/Nm"),
        (14.2, 3.1, "px m^2", "14.2 ± 3.1 px·m²"),
        (0.3, None, "1", "0.30000 (± not known)"),
        (7, 0.0, "frame", "7 frame"),
        (math.nan, 0.1, "px", "not known"),
        (None, None, "px", "not known"),
        (43210.0, 1234.0, "px", "43200 ± 1200 px"),
    ],
)
def test_a_measured_value(value: float | None, sigma: float | None, unit: str, shown: str) -> None:
    assert measured(value, sigma, unit) == shown


def test_a_value_that_rounds_to_zero_has_no_sign() -> None:
    assert plus_minus(-0.001, 1.5) == "0.0 ± 1.5"


@pytest.mark.parametrize(
    ("value", "shown"), [(0.0, "0 px"), (1.8e-10, "1.80·10⁻¹⁰ px"), (0.2314, "0.231 px")]
)
def test_a_plain_number(value: float, shown: str) -> None:
    assert number(value, "px") == shown


@pytest.mark.parametrize(
    ("p", "shown"),
    [(1e-40, "< 10⁻⁹"), (0.021, "= 0.021"), (2e-8, "= 2.0·10⁻⁸"), (None, "not known")],
)
def test_a_probability(p: float | None, shown: str) -> None:
    assert probability(p) == shown


@pytest.mark.parametrize(
    ("key", "shown"),
    [
        ("alpha0_px", "α₀"),
        ("offset_rad_3", "offset, joint 3"),
        ("rad_per_Nm_2", "joint 2"),
        ("bend_x_m", "bend x"),
        ("rad_per_g", "size"),
        ("relative", "relative"),
        ("k3", "k₃"),
        ("k4", "k₄"),
        ("q7", "q7"),
    ],
)
def test_a_parameter_in_words(key: str, shown: str) -> None:
    assert symbol(key) == shown
