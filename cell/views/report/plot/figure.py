"""Axes side by side on one drawing, and the legend under them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from cell.views.report.plot.axes import Axes
from cell.views.report.plot.marks import Series
from cell.views.report.plot.place import Place
from cell.views.report.plot.text import text_at, width_of

_POINTS = 72.0
_SYMBOL = 22.0
_ROW = 15.0
_LEGEND_SIZE = 9.0


class Figure:
    """A drawing of rows and columns of axes.

    Attributes
    ----------
    width, height:
        Points.
    axes:
        Row by row.
    """

    def __init__(
        self,
        width_in: float,
        height_in: float,
        columns: int,
        rows: int,
        width_ratios: Sequence[float] | None,
        shared: tuple[bool, bool],
    ) -> None:
        self.width, self.height = _POINTS * width_in, _POINTS * height_in
        self.rows, self.columns, self.shared = rows, columns, shared
        ratios = np.asarray(width_ratios or [1.0] * columns)
        self._shares = ratios / ratios.sum()
        self.axes = [Axes() for _ in range(rows * columns)]
        self._legend: tuple[list[Series], int] = ([], 1)

    def legend(self, series: list[Series], columns: int) -> None:
        """A legend under all axes."""
        self._legend = series, columns

    def svg(self, label: str) -> str:
        """The drawing as an SVG element; `label` is what a screen reader says."""
        body = "".join(self._bodies())
        return (
            f'<svg role="img" aria-label="{escape(label)}" xmlns="http://www.w3.org/2000/svg"'
            f' viewBox="0 0 {self.width:.1f} {self.height:.1f}"'
            f' font-family="DejaVu Sans, sans-serif">{body}</svg>'
        )

    def _bodies(self) -> list[str]:
        legend, columns = self._legend
        lines = -(-len(legend) // columns)
        space = self.height - (lines * _ROW + 4.0 if legend else 0.0)
        places = self._places(space)
        parts = [
            axes.svg(place, left, top, self._worded(k)) + _inside_legend(axes, place, left, top)
            for k, (axes, (place, left, top)) in enumerate(zip(self.axes, places, strict=True))
            if axes.marks
        ]
        return [*parts, self._legend_svg(space + 4.0)]

    def _worded(self, k: int) -> tuple[bool, bool]:
        """Whether the k-th axes have numbers at x and at y: shared ones have them once."""
        below = not self.shared[0] or k + self.columns >= len(self.axes)
        return below, not self.shared[1] or k % self.columns == 0

    def _reach(self, axis: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
        if not self.shared[axis]:
            return None
        return np.concatenate([axes.reach(axis) for axes in self.axes])

    def _places(self, space: float) -> list[tuple[Place, float, float]]:
        """Box and top left corner of each axes; boxes of a column and of a row are in line."""
        heights = space / self.rows
        reach = self._reach(0), self._reach(1)
        scales = [(a.scale(0, reach[0]), a.scale(1, reach[1])) for a in self.axes]
        margins = np.zeros((self.rows, self.columns, 4))
        for k, (axes, (_, y)) in enumerate(zip(self.axes, scales, strict=True)):
            labels = axes.ticks(1, y, 0.75 * heights)[1] if self._worded(k)[1] else []
            margins[divmod(k, self.columns)] = axes.margins(labels)
        aside, above = margins[..., :2].max(axis=0), margins[..., 2:].max(axis=1)
        starts = np.concatenate([[0.0], np.cumsum(self._shares)]) * self.width
        out = []
        for k, (axes, (x, y)) in enumerate(zip(self.axes, scales, strict=True)):
            row, column = divmod(k, self.columns)
            width = self._shares[column] * self.width - aside[column].sum()
            place, right, down = axes.fitted(Place(x, y, width, heights - above[row].sum()))
            left, top = starts[column] + aside[column, 0], row * heights + above[row, 0]
            out.append((place, float(left + right), float(top + down)))
        return out

    def _legend_svg(self, top: float) -> str:
        series, columns = self._legend
        if not series:
            return ""
        columns = min(columns, len(series))
        widths = [
            max(width_of(s.label, _LEGEND_SIZE) for s in series[c::columns]) + _SYMBOL + 18.0
            for c in range(columns)
        ]
        left = max((self.width - sum(widths)) / 2, 0.0)
        starts = left + np.concatenate([[0.0], np.cumsum(widths)])
        return "".join(
            _entry(s, float(starts[k % columns]), top + _ROW * (k // columns + 0.5))
            for k, s in enumerate(series)
        )


def _entry(series: Series, left: float, middle: float) -> str:
    labels = text_at(left + _SYMBOL + 5.0, middle + 3.2, series.label, size=_LEGEND_SIZE)
    return series.symbol(left, middle, _SYMBOL) + labels


def _named(axes: Axes) -> list[Series]:
    return [mark for mark in axes.marks if isinstance(mark, Series) and mark.label]


def _inside_legend(axes: Axes, place: Place, left: float, top: float) -> str:
    if axes.legend_at is None:
        return ""
    series = _named(axes)
    if axes.legend_at == "lower right":
        width = max(width_of(s.label, _LEGEND_SIZE) for s in series) + _SYMBOL + 10.0
        left, top = left + place.width - width, top + place.height - _ROW * len(series) - 4.0
    return "".join(_entry(s, left + 5.0, top + _ROW * (k + 0.6)) for k, s in enumerate(series))


def panels(
    width_in: float,
    height_in: float,
    columns: int = 1,
    rows: int = 1,
    *,
    width_ratios: Sequence[float] | None = None,
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[Figure, list[Axes]]:
    """A figure and its axes, row by row; shared axes have the same limits everywhere."""
    figure = Figure(width_in, height_in, columns, rows, width_ratios, (sharex, sharey))
    return figure, figure.axes


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3) -> None:
    """One legend for all axes, under the drawing, each entry once."""
    entries = {series.label: series for ax in axes for series in _named(ax)}
    figure.legend(list(entries.values()), columns)
