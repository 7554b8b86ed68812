"""Drawings: ticks one can read, data where they belong, and no library that draws."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from cell.views.report.plot import legend_below, panels
from cell.views.report.plot.colours import colours
from cell.views.report.plot.place import Place, Scale, scale_of

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize(
    ("low", "high", "count", "ticks", "words"),
    [
        (0.0, 10.0, 5, [0, 2, 4, 6, 8, 10], ["0", "2", "4", "6", "8", "10"]),
        (-0.31, 0.3, 5, [-0.2, 0.0, 0.2], ["−0.2", "0.0", "0.2"]),
        (4781.0, 4784.4, 4, [4781, 4782, 4783, 4784], ["4781", "4782", "4783", "4784"]),
        (3072.0, 0.0, 4, [0, 1000, 2000, 3000], ["0", "1000", "2000", "3000"]),
    ],
)
def test_ticks_are_round(
    low: float, high: float, count: int, ticks: list[float], words: list[str]
) -> None:
    scale = Scale(low, high)
    assert scale.ticks(count) == pytest.approx(ticks)
    assert scale.labels(scale.ticks(count)) == words


def test_logarithmic_ticks_are_one_two_five() -> None:
    scale = scale_of(np.array([0.3, 6.0, 0.0, np.nan]), log=True)
    assert scale.labels(scale.ticks(5)) == ["0.5", "1", "2", "5"]
    assert scale.share(math.sqrt(scale.low * scale.high)) == pytest.approx(0.5)


def test_limits_leave_room_and_infinite_lines_do_not_move_them() -> None:
    scale = scale_of(np.array([1.0, 2.0, -np.inf, np.inf, np.nan]))
    assert (scale.low, scale.high) == pytest.approx((0.95, 2.05))
    place = Place(scale, Scale(10.0, 0.0), 200.0, 100.0)
    x, y = place.at([-np.inf, 1.5, np.inf], [0.0, 5.0, 10.0])
    assert x.tolist() == pytest.approx([0.0, 100.0, 200.0])
    assert y.tolist() == [0.0, 50.0, 100.0]


def test_a_gap_in_the_data_is_a_gap_in_the_line_and_every_point_has_its_marker() -> None:
    figure, (ax,) = panels(4.0, 3.0)
    ax.plot([0, 1, np.nan, 3, 4], [0, 1, 2, 3, 4], color="#123456", marker="o", label="a < b")
    legend_below(figure, [ax])
    tree = ElementTree.fromstring(figure.svg("a & b"))
    assert tree.attrib["aria-label"] == "a & b"
    assert "a < b" in [text.text for text in tree.iter(f"{SVG}text")]
    drawn = [p.attrib for p in tree.iter(f"{SVG}path") if p.attrib.get("stroke") == "#123456"]
    line, markers, *_ = [path["d"] for path in drawn]
    assert (line.count("M"), line.count("L")) == (2, 2)
    assert markers.count("M") == 4


def test_one_scale_for_both_axes_where_asked_for() -> None:
    for aspect in ("box", "limits"):
        _, (ax,) = panels(6.0, 2.0)
        ax.plot([0.0, 1.0], [0.0, 1.0], color="#000000")
        ax.set(aspect=aspect)
        place, *_ = ax.fitted(Place(ax.scale(0), ax.scale(1), 400.0, 100.0))
        x, y = place.at([0.0, 1.0], [0.0, 1.0])
        assert abs(x[1] - x[0]) == pytest.approx(abs(y[1] - y[0]))


def test_an_arrow_of_one_unit_is_as_long_as_its_key() -> None:
    figure, (ax,) = panels(4.0, 3.0)
    ax.set(xlim=(0, 100), ylim=(100, 0))
    ax.quiver(np.array([[10.0, 10.0]]), np.array([[0.2, 0.0]]), unit=0.2, length=50.0,
              colors=["#abcdef"], key="0.2 px")  # fmt: skip
    tree = ElementTree.fromstring(figure.svg("arrows"))
    paths = [p.attrib for p in tree.iter(f"{SVG}path") if p.attrib.get("fill") != "none"]

    def width(path: str) -> float:
        across = [float(point.split()[0]) for point in path.strip("Mz").split("L")]
        return max(across) - min(across)

    drawn, key = (width(p["d"]) for p in paths if p.get("fill") in ("#abcdef", "#000000"))
    assert drawn == pytest.approx(key, abs=0.2)


def test_colours_run_from_end_to_end_and_nothing_has_none() -> None:
    found = colours(np.array([-1.0, 0.0, 1.0, 9.0, np.nan]), "PuOr", -1.0, 1.0)
    assert found == ["#7f3b08", "#f7f7f7", "#2d004b", "#2d004b", ""]
