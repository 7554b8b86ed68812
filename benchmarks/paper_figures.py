"""The paper's Figs. 3, 4, 7, 13, 14 and 15 from the simulated cells, with their numbers.

    python -m benchmarks.paper_figures [FOLDER]

Writes one SVG a figure into `docs/pictures` (or FOLDER) and prints, as Markdown, the paper's
numbers beside those of the figures drawn.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.paper_runs import Run, run_named
from benchmarks.paper_tables import NAMES, TABLE_2
from calib.chain.rigid import inverse
from calib.paper.focus_law import FocusLaw
from calib.views import FloatArray
from cell.views.report.figures.canvas import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILLION

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
CELLS = {"ur3-robotiq": "Robotiq wrist camera", "irb140-eosens": "EoSens 12CXP+"}
SHOWN = {
    "fixed_alpha_algebraic": (BLUE, "o", "--"),
    "held_mle": (GREEN, "s", "--"),
    "fixed_alpha_mle": (GREEN, "D", "-"),
    "zhang_algebraic": (VERMILLION, "v", "-"),
    "zhang_mle": (BLACK, "^", "-"),
}
"""Colours of the paper's Fig. 15: blue, green, red, black; section 3.2's own fit beside its Table
1's."""

LENS_RADIUS_M, FOCAL_LENGTH_M = 0.005, 0.018
"""Of Fig. 7, whose caption gives neither: the 18 mm lens of the paper at f/1.8."""


@dataclass(frozen=True)
class Number:
    """One line beside a figure: what it is, what the paper has, what the simulated cell gives."""

    what: str
    paper: str
    here: str


# --- data ---------------------------------------------------------------------------------------


def by_equation_9(distance_m: FloatArray, off_axis: float = 0.0) -> FloatArray:
    """(N,) the paper's focal length, metres, of a point at `off_axis` times its distance.

    omega = k phi with k such that a point at infinity on the axis gives the lens' focal length.
    """
    height = off_axis * distance_m
    k = np.arctan(FOCAL_LENGTH_M / LENS_RADIUS_M) / (np.pi / 2)
    omega = k * np.arctan2(distance_m, LENS_RADIUS_M - height)
    slope = np.tan(np.pi / 2 - omega)
    return np.asarray(LENS_RADIUS_M / (slope - height / distance_m))


def by_thin_lens(distance_m: FloatArray) -> FloatArray:
    """(N,) image distance, metres, of an ideal lens focused at each distance."""
    return np.asarray(FOCAL_LENGTH_M * distance_m / (distance_m - FOCAL_LENGTH_M))


def positions_m(camera_from_board: FloatArray) -> FloatArray:
    """(N, 3) cameras in the board's frame."""
    return np.asarray(inverse(camera_from_board)[:, :3, 3])


def law_named(found: Run, law: str) -> FocusLaw:
    """One of the laws that were fitted to the scale factors."""
    assert found.whole.focus_law is not None
    return next(c for c in found.whole.focus_law.candidates if c.law == law)


# --- numbers ------------------------------------------------------------------------------------


def _range(values: FloatArray) -> str:
    return f"{values.min():+.0f} to {values.max():+.0f} mm"


def numbers_3_and_4() -> list[Number]:
    """Zhang's maximum-likelihood cameras on the EoSens."""
    error = 1e3 * run_named("irb140-eosens").error_m("zhang_mle")
    closer = int((error[:, 2] > 0).sum())
    return [
        Number("computed closer to the board", "all 10", f"{closer} of {len(error)}"),
        Number("z: mean", "+100 mm", f"{error[:, 2].mean():+.1f} mm"),
        Number("z: range", "+60 to +160 mm", _range(error[:, 2])),
        Number("x: range", "-75 to +75 mm", _range(error[:, 0])),
        Number("y: range", "-75 to +75 mm", _range(error[:, 1])),
    ]


def numbers_7() -> list[Number]:
    """Eq. 9 on the axis and off it, and a thin lens, at 0.3, 0.7 and 2.7 m."""
    at = np.array([0.3, 0.7, 2.7])
    rows = (
        ("Eq. 9, on the axis", "rises to a constant", by_equation_9(at)),
        ("Eq. 9, at a = 0.2 d", "-", by_equation_9(at, 0.2)),
        ("thin lens that moves as a whole", "-", by_thin_lens(at)),
    )
    return [
        Number(f"{name}: f at 0.3, 0.7, 2.7 m", paper, ", ".join(f"{1e3 * f:.2f}" for f in values))
        for name, paper, values in rows
    ]


def numbers_13(cell: str) -> list[Number]:
    """Scale factors along u, and where the zones end."""
    found, table = run_named(cell), TABLE_2[cell]
    factors, zones = found.whole.scale_factors, found.whole.zones
    near, far = (ends(factors, key=lambda f: f.distance_m) for ends in (min, max))
    paper_limits = {"ur3-robotiq": "150 mm, 1200 mm", "irb140-eosens": "700 mm, about 2700 mm"}[
        cell
    ]
    limits = "none" if zones is None else f"{zones.near_limit_m:.2f} m, {zones.far_limit_m:.2f} m"
    reported = {name: found.solutions[name].values["alpha_px"] for name in table if name in NAMES}
    return [
        Number("alpha far away", f"{table['proposed'][0]:g}", f"{found.alpha0['alpha_px']:.1f}"),
        *(Number(NAMES[name], f"{table[name][0]:g}", f"{reported[name]:.1f}") for name in reported),
        Number("zone 2: from, to", paper_limits, limits),
        Number(
            f"one view's sigma at {near.distance_m:.2f} and {far.distance_m:.2f} m",
            "-",
            f"{near.alpha_sigma_px:.2f} px, {far.alpha_sigma_px:.2f} px",
        ),
    ]


def numbers_14(cell: str) -> list[Number]:
    """Eq. 25 fitted to the scale factors, against its rivals."""
    choice = run_named(cell).whole.focus_law
    assert choice is not None
    law = law_named(run_named(cell), "inverse_square")
    found = {name: f"{p.value:.5g} ± {p.sigma:.2g} {p.unit}" for name, p in law.parameters.items()}
    return [
        Number("alpha0", f"{TABLE_2[cell]['proposed'][0]:g}", found["alpha0_px"]),
        Number("k_f", "not given", found["k_px_m2"]),
        Number("better than a constant by", "-", choice.why),
    ]


def numbers_15(cell: str) -> list[Number]:
    """Root mean square and mean z of every solution's camera positions."""
    errors = run_named(cell).error
    return [
        Number(
            NAMES[name],
            _PAPER_15.get(name, "-"),
            f"{1e3 * errors[name].rms:.2f} mm, z {1e3 * errors[name].mean[2]:+.2f} mm",
        )
        for name in SHOWN
    ]


_PAPER_15 = {
    "fixed_alpha_algebraic": "near the truth",
    "held_mle": "near the truth",
    "zhang_algebraic": "worse than both",
    "zhang_mle": "worst",
}


# --- drawings -----------------------------------------------------------------------------------


def figure_3() -> Figure:
    """True cameras and computed ones, from above and from the side."""
    found = run_named("irb140-eosens")
    true = positions_m(found.camera_from_board)
    reported = positions_m(found.solutions["zhang_mle"].camera_from_board)
    figure, axes = _panels(2)
    for axis, across, name in zip(axes, (0, 1), "xy", strict=True):
        for a, b in zip(true, reported, strict=True):
            axis.plot([-a[2], -b[2]], [a[across], b[across]], color=GREY, linewidth=1)
        axis.plot(-true[:, 2], true[:, across], "*", color=BLUE, markersize=8, label="true")
        axis.plot(-reported[:, 2], reported[:, across], "^", color=BLACK, label="Zhang, MLE")
        axis.plot([0, 0], [0, (0.225, 0.15)[across]], color=VERMILLION, linewidth=4, label="board")
        axis.set_xlabel("in front of the board, m")
        axis.set_ylabel(f"board {name}, m")
    _legend_below(figure, axes[0], 3)
    return figure


def figure_4() -> Figure:
    """The camera's error along x, y and z, view by view."""
    error = 1e3 * run_named("irb140-eosens").error_m("zhang_mle")
    figure, axes = _panels(3)
    for axis, values, name in zip(axes, error.T, "xyz", strict=True):
        axis.bar(np.arange(1, len(values) + 1), values, color=BLACK if name == "z" else GREY)
        axis.axhline(0, color=BLACK, linewidth=0.8)
        axis.set_ylim(-40, 1.08 * error.max())
        axis.set_xlabel("view, near to far")
        axis.set_title(f"{name}, mm")
    return figure


def figure_7() -> Figure:
    """Focal length over distance, by Eq. 9 and by a lens."""
    distance = np.geomspace(0.1, 3.0, 300)
    figure, (axis,) = _panels(1)
    axis.plot(distance, 1e3 * by_equation_9(distance), color=BLACK, label="Eq. 9, on the axis")
    axis.plot(distance, 1e3 * by_thin_lens(distance), color=BLUE, label="thin lens, f d / (d − f)")
    axis.axhline(1e3 * FOCAL_LENGTH_M, color=GREY, linestyle=":", label="far away")
    axis.set_xlabel("distance, m")
    axis.set_ylabel("focal length, mm")
    axis.legend()
    return figure


def figure_13() -> Figure:
    """Scale factors of the parallel views, and what each method takes for all."""
    figure, axes = _panels(2)
    for axis, cell in zip(axes, CELLS, strict=True):
        found = run_named(cell)
        _crosses(axis, found)
        lines = (
            ("far away, by the law found", found.alpha0["alpha_px"], BLACK),
            ("Zhang, MLE", found.solutions["zhang_mle"].values["alpha_px"], VERMILLION),
            ("Zhang, algebraic", found.solutions["zhang_algebraic"].values["alpha_px"], BLUE),
        )
        for name, value, colour in lines:
            axis.axhline(value, color=colour, label=name)
        _over_distance(axis, cell)
    return figure


def figure_14() -> Figure:
    """Eq. 25 through the scale factors, and a thin lens' curve."""
    figure, axes = _panels(2)
    for axis, cell in zip(axes, CELLS, strict=True):
        found = run_named(cell)
        _crosses(axis, found)
        distance = np.linspace(*axis.get_xlim(), 200).clip(0.3)
        for law, colour, name in (
            ("inverse_square", VERMILLION, "Eq. 25"),
            ("thin_lens", ORANGE, "thin lens' law"),
        ):
            axis.plot(distance, law_named(found, law).scale_px(distance), color=colour, label=name)
        _over_distance(axis, cell)
    return figure


def figure_15() -> Figure:
    """How far each solution's cameras are from the true ones."""
    figure, axes = _panels(2)
    for axis, cell in zip(axes, CELLS, strict=True):
        found = run_named(cell)
        for name, (colour, marker, line) in SHOWN.items():
            off = 1e3 * np.linalg.norm(found.error_m(name), axis=1)
            views = np.arange(1, len(off) + 1)
            axis.semilogy(
                views, off, color=colour, marker=marker, linestyle=line, label=_short(name)
            )
        axis.set_title(CELLS[cell])
        axis.set_xlabel("view, near to far")
        axis.set_ylabel("camera off by, mm")
    _legend_below(figure, axes[0], 3)
    return figure


def _legend_below(figure: Figure, axis: Axes, columns: int) -> None:
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)


def _short(name: str) -> str:
    return NAMES[name].partition(" (")[0].replace(" for all views", "").replace("held at ", "")


def _crosses(axis: Axes, found: Run) -> None:
    factors = found.whole.scale_factors
    axis.plot([f.distance_m for f in factors], [f.alpha_px for f in factors], "x", color=BLACK)


def _over_distance(axis: Axes, cell: str) -> None:
    axis.set_title(CELLS[cell])
    axis.set_xlabel("distance, m")
    axis.set_ylabel("alpha, px")
    axis.ticklabel_format(useOffset=False)
    axis.legend(fontsize=8)


def _panels(columns: int) -> tuple[Figure, Sequence[Axes]]:
    figure = Figure(figsize=(4.1 * columns if columns > 1 else 6.0, 3.2), layout="constrained")
    axes = figure.subplots(1, columns, squeeze=False)[0]
    for axis in axes:
        axis.grid(color="#e3e6ea")
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, list(axes)


@dataclass(frozen=True)
class Drawing:
    """A figure: its file, how it is drawn, and its numbers with a heading each."""

    file: str
    draw: Callable[[], Figure]
    numbers: dict[str, Callable[[], list[Number]]]


def _of_cells(numbers: Callable[[str], list[Number]]) -> dict[str, Callable[[], list[Number]]]:
    return {CELLS[cell]: lambda cell=cell: numbers(cell) for cell in CELLS}  # type: ignore[misc]


FIGURES = {
    "Fig. 3": Drawing("paper-fig-03.svg", figure_3, {}),
    "Fig. 4": Drawing("paper-fig-04.svg", figure_4, {"EoSens 12CXP+": numbers_3_and_4}),
    "Fig. 7": Drawing("paper-fig-07.svg", figure_7, {"18 mm lens, f in mm": numbers_7}),
    "Fig. 13": Drawing("paper-fig-13.svg", figure_13, _of_cells(numbers_13)),
    "Fig. 14": Drawing("paper-fig-14.svg", figure_14, _of_cells(numbers_14)),
    "Fig. 15": Drawing("paper-fig-15.svg", figure_15, _of_cells(numbers_15)),
}


def table(heading: str, numbers: Sequence[Number]) -> str:
    """Numbers beside each other, as Markdown."""
    lines = [f"| {heading} | paper | simulated |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {n.what} | {n.paper} | {n.here} |" for n in numbers)])


def main() -> None:
    """Draw everything, and print the numbers."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURES
    # texts as texts and no date: small files, the same ones in every run
    mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "paper", "font.size": 9})
    for name, drawing in FIGURES.items():
        drawing.draw().savefig(folder / drawing.file, metadata={"Date": None})
        for heading, numbers in drawing.numbers.items():
            print(f"\n{name}\n\n{table(heading, numbers())}")


if __name__ == "__main__":
    main()
