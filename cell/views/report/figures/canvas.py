"""How every drawing of the report looks: colours, and markers that say the same again."""

from __future__ import annotations

from typing import Any

# Okabe and Ito's palette, distinct with every kind of colour vision; line style and marker say
# the same thing again, for a print without colour.
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#8a8f98",
)  # fmt: skip
STYLES: dict[str, dict[str, Any]] = {
    "joint_ml": {"color": BLUE, "marker": "o", "linestyle": "-"},
    "fixed_alpha_mle": {"color": GREEN, "marker": "s", "linestyle": "-"},
    "fixed_alpha_algebraic": {"color": SKY, "marker": "D", "linestyle": "--"},
    "zhang_mle": {"color": VERMILLION, "marker": "^", "linestyle": "-"},
    "zhang_algebraic": {"color": ORANGE, "marker": "v", "linestyle": "--"},
}
_OTHER = {"color": PURPLE, "marker": "x", "linestyle": ":"}


def style(solution: str) -> dict[str, Any]:
    """Colour, marker and line of a solution, the same in every drawing."""
    return STYLES.get(solution, _OTHER)
