"""One pair of axes: what stands in it, its limits, and how it is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from calib.views import FloatArray
from cell.views.report.plot.colours import colours
from cell.views.report.plot.marks import Arrows, Mark, Series, Squares, TextMark, Tiles
from cell.views.report.plot.place import Place, Scale, scale_of
from cell.views.report.plot.text import SIZE, text_at, width_of

_GRID, _EDGE = "#e3e6ea", "#5b616b"
_POINTS_PER_TICK = (42.0, 28.0)
_BAR = 46.0
"""Room for a colour bar with its numbers and its name, points."""
Limits = tuple[float, float]


def _array(values: ArrayLike) -> FloatArray:
    return np.asarray(values, dtype=np.float64).reshape(-1)


class Axes:
    """Axes of a drawing; methods and options have the names they have in Matplotlib.

    Attributes
    ----------
    title, xlabel, ylabel:
        What is written above, below and beside.
    marks:
        What stands in it.
    """

    def __init__(self) -> None:
        self.title = self.xlabel = self.ylabel = ""
        self.marks: list[Mark] = []
        self.grid = [True, True]
        self.log_y = False
        self.tick_labels: tuple[list[float], list[str]] | None = None
        self.legend_at: Literal["upper left", "lower right"] | None = None
        self._limits: list[Limits | None] = [None, None]
        self._aspect: Literal["free", "box", "limits"] = "free"
        self._down = False
        self._head_room = 0.0
        self._bar: tuple[str, float, float, str] | None = None
        self._key: tuple[Arrows, str] | None = None

    def set(
        self,
        *,
        title: str | None = None,
        xlabel: str | None = None,
        ylabel: str | None = None,
        xlim: Limits | None = None,
        ylim: Limits | None = None,
        aspect: Literal["box", "limits"] | None = None,
        down: bool | None = None,
    ) -> None:
        """Set titles and limits.

        `aspect` makes a unit of x and of y as long, by a smaller box or by wider limits; `down`
        lets y grow downwards.
        """
        for name, labels in (("title", title), ("xlabel", xlabel), ("ylabel", ylabel)):
            if labels is not None:
                setattr(self, name, labels)
        for axis, limits in enumerate((xlim, ylim)):
            if limits is not None:
                self._limits[axis] = limits
        self._aspect = aspect or self._aspect
        self._down = self._down if down is None else down

    @property
    def key_limits(self) -> Limits:
        """The values at both ends of the colour bar."""
        assert self._bar is not None
        return self._bar[1:3]

    def head_room(self, share: float) -> None:
        """Leave so much more of the height free above the data."""
        self._head_room = share

    def plot(self, x: ArrayLike, y: ArrayLike, **look: Any) -> None:
        """Points joined or marked; `look` as `Series` has it."""
        self.marks.append(Series(_array(x), _array(y), **look))

    def axhline(self, y: float, **look: Any) -> None:
        """A line across the whole width."""
        self.plot([-np.inf, np.inf], [y, y], **look)

    def axvline(self, x: float, **look: Any) -> None:
        """A line over the whole height."""
        self.plot([x, x], [-np.inf, np.inf], **look)

    def axvspan(self, low: float, high: float, color: str) -> None:
        """A shaded range of x."""
        ends = _array([-np.inf]), _array([np.inf])
        self.marks.append(Tiles(_array([low]), _array([high]), *ends, [color], zorder=0.0))

    def errorbar(
        self, x: ArrayLike, y: ArrayLike, sigma: ArrayLike, *, ecolor: str, **look: Any
    ) -> None:
        """Points with a line of one sigma to either side."""
        x, y, sigma = _array(x), _array(y), _array(sigma)
        gap = np.full(len(x), np.nan)
        ends = np.stack([y - sigma, y + sigma, gap], axis=1)
        below = float(look.get("zorder", 2.0)) - 0.1
        self.plot(np.repeat(x, 3), ends, color=ecolor, linewidth=1.1, zorder=below)
        self.plot(x, y, linestyle="", **look)

    def steps(self, edges: FloatArray, heights: FloatArray, **look: Any) -> None:
        """The outline of a histogram."""
        outline = np.concatenate([[0.0], np.repeat(heights, 2), [0.0]])
        self.plot(np.repeat(edges, 2), outline, **look)

    def bars(self, edges: FloatArray, heights: FloatArray, color: str) -> None:
        """A histogram's bars, standing on zero."""
        zero = np.zeros(len(heights))
        names = [color] * len(heights)
        self.marks.append(Tiles(edges[:-1], edges[1:], zero, heights, names, edge="#ffffff"))
        self._limits[1] = (0.0, 1.05 * max(float(heights.max()), 1e-9))

    def barh(
        self, names: Sequence[str], values: Sequence[float], colors: Sequence[str], fmt: str
    ) -> None:
        """Horizontal bars from the bottom up, each named and with its value at its end."""
        at = np.arange(len(names), dtype=np.float64)
        ends = _array(values)
        zero = np.zeros(len(at))
        self.marks.append(Tiles(zero, ends, at - 0.3, at + 0.3, colors, zorder=2.0))
        for y, value in zip(at, values, strict=True):
            self.marks.append(TextMark(value, float(y), fmt % value, right=4.0, up=-3.0))
        self.tick_labels = at.tolist(), list(names)
        self.grid[1] = False

    def image(self, values: FloatArray, x: Limits, y: Limits, *, colormap: str, limits: Limits,
              name: str) -> None:  # fmt: skip
        """A map of cells from `x` to `x` and from the top `y` to the bottom `y`, and its key."""
        rows, columns = values.shape
        left = np.linspace(*x, columns + 1)
        top = np.linspace(*y, rows + 1)
        row, column = np.divmod(np.arange(values.size), columns)
        self.marks.append(
            Tiles(
                left[column],
                left[column + 1],
                top[row + 1],
                top[row],
                colours(values.ravel(), colormap, *limits),
                zorder=0.5,
            )
        )
        self.set(xlim=x, ylim=(y[1], y[0]), aspect="box")
        self.grid = [False, False]
        self._bar = (colormap, *limits, name)

    def squares(self, at: FloatArray, values: FloatArray, *, size: float, name: str) -> None:
        """Squares at (N, 2) points, shaded by `values` from zero on, and a key of the shades."""
        high = float(np.nanmax(values)) if len(values) else 1.0
        shades = colours(values, "cividis_r", 0.0, high)
        self.marks.append(Squares(at[:, 0], at[:, 1], shades, size))
        self._bar = ("cividis_r", 0.0, high, name)

    def quiver(
        self,
        at: FloatArray,
        arrows: FloatArray,
        *,
        unit: float,
        length: float,
        colors: Sequence[str],
        key: str = "",
    ) -> None:
        """(N, 2) arrows; `unit` of them is drawn as `length` of x; `key` says what `unit` is."""
        drawn = Arrows(at[:, 0], at[:, 1], arrows[:, 0], arrows[:, 1], colors, unit, length)
        self.marks.append(drawn)
        if key:
            self._key = drawn, key

    def annotate(self, labels: str, x: float, y: float, **look: Any) -> None:
        """Words at a point; `look` as `TextMark` has it."""
        self.marks.append(TextMark(x, y, labels, **look))

    # what follows is for the figure: limits, margins, and the SVG text

    def reach(self, axis: int) -> FloatArray:
        """The data of x (0) or y (1) that ask for a place."""
        return np.concatenate([np.zeros(0), *(mark.reach()[axis] for mark in self.marks)])

    def scale(self, axis: int, reach: FloatArray | None = None) -> Scale:
        """The scale of x or y, for its own data or those of axes that share it."""
        limits = self._limits[axis]
        if limits is not None:
            return Scale(*limits)
        scale = scale_of(self.reach(axis) if reach is None else reach, log=axis == 1 and self.log_y)
        if axis == 1:
            scale = replace(scale, high=scale.high + self._head_room * (scale.high - scale.low))
            scale = Scale(scale.high, scale.low) if self._down else scale
        return scale

    def fitted(self, place: Place) -> tuple[Place, float, float]:
        """The place with x and y to one scale where asked for, and how far it moves right, down."""
        if self._aspect == "free":
            return place, 0.0, 0.0
        wide, high = abs(place.x.high - place.x.low), abs(place.y.high - place.y.low)
        points = min(place.width / wide, place.height / high)
        if self._aspect == "box":
            box = replace(place, width=points * wide, height=points * high)
            return box, (place.width - box.width) / 2, (place.height - box.height) / 2
        x = _widened(place.x, place.width / points / wide)
        return replace(place, x=x, y=_widened(place.y, place.height / points / high)), 0.0, 0.0

    def ticks(self, axis: int, scale: Scale, points: float) -> tuple[list[float], list[str]]:
        """Where ticks are, and what is written there."""
        if axis == 1 and self.tick_labels is not None:
            return self.tick_labels
        at = scale.ticks(points / _POINTS_PER_TICK[axis])
        return at, scale.labels(at)

    def margins(self, y_labels: list[str]) -> tuple[float, float, float, float]:
        """Room needed left, right, above and below the box, points."""
        left = max(map(width_of, y_labels), default=0.0) + 8.0 + (15.0 if self.ylabel else 0.0)
        right = 10.0 if self._bar is None else _BAR
        above = 18.0 if self.title or self._key else 8.0
        return left, right, above, 16.0 + (15.0 if self.xlabel else 0.0)

    def svg(self, place: Place, left: float, top: float, labels: tuple[bool, bool]) -> str:
        """All of it, the box's top left corner at (left, top); `labels`: whether ticks have any."""
        ticks = [self.ticks(0, place.x, place.width), self.ticks(1, place.y, place.height)]
        inside = "".join(m.svg(place) for m in sorted(self.marks, key=lambda m: m.zorder))
        parts = [
            self._frame(place, ticks, labels),
            f'<svg width="{place.width:.1f}" height="{place.height:.1f}">{inside}</svg>',
            self._titles(place, ticks[1][1] if labels[1] else []),
            self._colour_bar(place),
            self._arrow_key(place),
        ]
        return f'<g transform="translate({left:.1f} {top:.1f})">{"".join(parts)}</g>'

    def _frame(
        self, place: Place, ticks: list[tuple[list[float], list[str]]], labels: tuple[bool, bool]
    ) -> str:
        across = place.at(ticks[0][0], np.full(len(ticks[0][0]), np.nan))[0].tolist()
        down = place.at(np.full(len(ticks[1][0]), np.nan), ticks[1][0])[1].tolist()
        width, height = place.width, place.height
        grid = "".join(f"M{x:.1f} 0v{height:.1f}" for x in across) if self.grid[0] else ""
        grid += "".join(f"M0 {y:.1f}h{width:.1f}" for y in down) if self.grid[1] else ""
        edge = f"M0 0v{height:.1f}h{width:.1f}"
        edge += "".join(f"M{x:.1f} {height:.1f}v3.5" for x in across)
        edge += "".join(f"M0 {y:.1f}h-3.5" for y in down)
        below = zip(across, ticks[0][1], strict=True) if labels[0] else ()
        beside = zip(down, ticks[1][1], strict=True) if labels[1] else ()
        return (
            (f'<path d="{grid}" stroke="{_GRID}" stroke-width="0.8"/>' if grid else "")
            + f'<path d="{edge}" fill="none" stroke="{_EDGE}" stroke-width="0.8"/>'
            + "".join(text_at(x, height + 14.0, word, anchor="middle") for x, word in below)
            + "".join(text_at(-6.0, y + 3.5, word, anchor="end") for y, word in beside)
        )

    def _titles(self, place: Place, y_labels: list[str]) -> str:
        aside = -13.0 - max(map(width_of, y_labels), default=0.0)
        return "".join(
            (
                text_at(0.0, -6.0, self.title, size=10, bold=True) if self.title else "",
                text_at(place.width / 2, place.height + 29.0, self.xlabel, anchor="middle")
                if self.xlabel
                else "",
                text_at(aside, place.height / 2, self.ylabel, anchor="middle", turned=True)
                if self.ylabel
                else "",
            )
        )

    def _colour_bar(self, place: Place) -> str:
        if self._bar is None:
            return ""
        colormap, low, high, name = self._bar
        scale = Scale(low, high)
        bar = Place(Scale(0.0, 1.0), scale, 8.0, 0.8 * place.height)
        edges = np.linspace(low, high, 33)
        shades = colours(0.5 * (edges[1:] + edges[:-1]), colormap, low, high)
        ends = np.zeros(32), np.ones(32)
        ticks = scale.ticks(bar.height / 28.0)
        labels = scale.labels(ticks)
        middle = bar.at(0.0, ticks)[1].tolist()
        numbers = "".join(
            text_at(11.0, y + 3.2, w, size=9) for y, w in zip(middle, labels, strict=True)
        )
        aside = 14.0 + max((width_of(word, 9.0) for word in labels), default=0.0) + SIZE / 2
        title = text_at(aside, bar.height / 2, name, size=9, anchor="middle", turned=True)
        body = Tiles(*ends, edges[:-1], edges[1:], shades).svg(bar) + numbers + title
        at = f"translate({place.width + 6.0:.1f} {0.1 * place.height:.1f})"
        return f'<g transform="{at}">{body}</g>'

    def _arrow_key(self, place: Place) -> str:
        if self._key is None:
            return ""
        arrows, labels = self._key
        long = arrows.length * place.width / abs(place.x.high - place.x.low)
        start = place.width - width_of(labels) - long - 4.0
        shape = arrows.outline(start, -9.0, start + long, -9.0)
        text = text_at(start + long + 4.0, -5.5, labels)
        return f'<path d="{shape}" fill="#000000"/>{text}'


def _widened(scale: Scale, factor: float) -> Scale:
    middle, half = (scale.low + scale.high) / 2, factor * (scale.high - scale.low) / 2
    return replace(scale, low=middle - half, high=middle + half)
