"""URDF texts of arms that nobody builds."""

from __future__ import annotations

from collections.abc import Sequence

Row = tuple[str, tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]

OFFSET_WRIST: tuple[Row, ...] = (
    ("pan", (0.0, 0.0, 0.265), (0, 0, 0), (0, 0, 1)),
    ("lift", (0.02, 0.0, 0.0), (0, 0, 0), (0, 1, 0)),
    ("elbow", (0.0, 0.03, 0.444), (0, 0, 0), (0, 1, 0)),
    ("roll", (0.0, 0.0, 0.11), (0, 0, 0), (1, 0, 0)),
    ("bend", (0.47, 0.0, 0.0), (0, 0, 0), (0, 1, 0)),
    ("turn", (0.101, 0.0, 0.08), (0, 0, 0), (1, 0, 0)),
)
"""A wrist set off by 8 cm, and a shoulder by 2 and 3 cm."""

OBLIQUE: tuple[Row, ...] = (
    ("a", (0.0, 0.0, 0.3), (0.1, -0.2, 0.3), (0, 0, 1)),
    ("b", (0.05, 0.02, 0.1), (0.3, 0.1, 0.0), (0.2, 1, 0.1)),
    ("c", (0.1, 0.0, 0.4), (0.0, 0.4, 0.2), (0, -1, 0.3)),
    ("d", (0.2, 0.05, 0.1), (0.5, 0.0, 0.1), (1, 0.2, 0)),
    ("e", (0.2, 0.0, 0.05), (0.0, 0.2, 0.6), (0, 1, 1)),
    ("f", (0.1, 0.03, 0.0), (0.1, 0.3, 0.0), (1, 1, 0)),
)
"""No two axes parallel, square or meeting."""


def urdf(rows: Sequence[Row], *, limit: str = 'lower="-3.1" upper="3.1" velocity="2"') -> str:
    """A chain base_link, one link a joint, tool0."""
    parts = ['<robot name="made_up"><link name="base_link"/>']
    parent = "base_link"
    for name, xyz, rpy, axis in rows:
        child = f"{name}_link"
        parts.append(
            f'<link name="{child}"><inertial><origin xyz="0.01 0.02 0.05"/><mass value="2.5"/>'
            f'</inertial></link><joint name="{name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/>'
            f'<axis xyz="{_words(axis)}"/><limit effort="1" {limit}/></joint>'
        )
        parent = child
    parts.append(
        f'<link name="tool0"/><joint name="flange" type="fixed"><parent link="{parent}"/>'
        '<child link="tool0"/><origin xyz="0 0 0.02" rpy="0 1.5707963267948966 0"/></joint></robot>'
    )
    return "".join(parts)


def _words(numbers: Sequence[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
