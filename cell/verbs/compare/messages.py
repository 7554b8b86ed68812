"""A comparison in words, and as plain data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from cell.verbs.compare.comparison import Comparison, Difference
from cell.views.terminal.columns import aligned

SCHEMA = "cell.comparison/1"
TITLES = {
    "camera": "The cameras by themselves (frames aligned)",
    "mounted": "As mounted on the robot (hand-eye included)",
}
HEAD = ("distance m", "rms px", "worst px", "at u, v", "chance px", "lateral mm", "depth mm", "p")


def verdict(difference: Difference) -> str:
    """One sentence."""
    match difference.beyond_chance:
        case None:
            return "whether they differ by more than chance is not known: no uncertainties"
        case True:
            return f"they differ by more than chance (p {_chance(difference.p_value, 1)})"
        case _:
            return f"they agree within their uncertainty (p {_chance(difference.p_value, 2)})"


_LEAST_P = 1e-99


def _chance(p_value: float | None, digits: int) -> str:
    assert p_value is not None
    return f"< {_LEAST_P:g}" if p_value < _LEAST_P else f"= {p_value:.{digits}g}"


def parts(comparison: Comparison) -> dict[str, Difference]:
    """The differences there are, by their key in `TITLES`."""
    found = {"camera": comparison.camera, "mounted": comparison.mounted}
    return {key: part for key, part in found.items() if part is not None}


def table(difference: Difference) -> list[tuple[str, ...]]:
    """Rows under `HEAD`."""
    return [
        (
            f"{r.distance_m:.3f}",
            f"{r.rms_px:.3f}",
            f"{r.worst_px:.3f}",
            f"{r.worst_at_px[0]:.0f}, {r.worst_at_px[1]:.0f}",
            f"{r.by_chance_px:.3f}",
            f"{r.lateral_mm:.3f}",
            f"{r.depth_mm:+.3f} ± {r.depth_sigma_mm:.3f}",
            "-" if r.p_value is None else f"{r.p_value:.2g}",
        )
        for r in difference.rows
    ]


def text(comparison: Comparison) -> str:
    """For the terminal."""
    lines = []
    for letter, side in (("A", comparison.a), ("B", comparison.b)):
        lines.append(f"{letter}  {side.label}: recording {side.recording}, {side.solution}")
    for key, part in parts(comparison).items():
        lines += ["", f"{TITLES[key]}: {verdict(part)}", *aligned([HEAD, *table(part)])]
    lines += [
        "",
        "px: B minus A over the image; chance: rms that the uncertainties alone would make;",
        "lateral: rms at that distance; depth: how much farther B puts a thing of known size.",
        *(f"note: {note}" for note in comparison.notes),
    ]
    return "\n".join(lines)


def as_mapping(comparison: Comparison) -> dict[str, Any]:
    """As one JSON object, the map of differences included."""
    field = comparison.field
    content: dict[str, Any] = {"schema": SCHEMA}
    for key, side in (("a", comparison.a), ("b", comparison.b)):
        content[key] = {
            "path": side.label,
            "recording": side.recording,
            "solution": side.solution,
            "law": side.law,
            **side.origin.model_dump(),
        }
    content |= {"distances_m": field.distances_m.tolist(), "pixels": field.pixels.tolist()}
    content |= {"camera": None, "mounted": None, "notes": list(comparison.notes)}
    for key, part in parts(comparison).items():
        content[key] = {
            "beyond_chance": part.beyond_chance,
            "p_value": part.p_value,
            "rows": [asdict(row) for row in part.rows],
            "difference_px": part.map_px.tolist(),
        }
    return content
