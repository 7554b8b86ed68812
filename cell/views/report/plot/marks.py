"""What stands in a pair of axes; each kind says how far it reaches and writes itself as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from calib.views import FloatArray
from cell.views.report.plot.place import Place
from cell.views.report.plot.text import text_at

_DASHES = {"-": "", "--": "5 2.5", ":": "1.2 2", "-.": "6 2.5 1.2 2.5"}
_STROKES = "x_"
"""Markers that have no inside."""
_NOTHING = np.zeros(0)


class Mark(Protocol):
    """Something drawn in the coordinates of the data."""

    @property
    def zorder(self) -> float:
        """What is higher is drawn over what is lower."""
        ...

    def reach(self) -> tuple[FloatArray, FloatArray]:
        """Data coordinates that should be in the picture."""
        ...

    def svg(self, place: Place) -> str:
        """The elements, relative to the box's top left corner."""
        ...


def marker_path(marker: str, size: float) -> str:
    """A marker of that size, as a path that starts at its middle."""
    r = 0.5 * size
    t = 0.87 * r
    if marker == ".":
        return marker_path("o", 0.5 * size)
    if marker == "*":
        turn = np.arange(11) * np.pi / 5
        radius = np.where(np.arange(11) % 2 == 0, r, 0.4 * r)
        corners = np.stack([radius * np.sin(turn), -radius * np.cos(turn)], axis=1)
        steps = "".join(f"l{dx:.2f} {dy:.2f}" for dx, dy in np.diff(corners, axis=0).tolist())
        return f"m0 {-r:.2f}{steps}z"
    arc = f"a{r:.2f} {r:.2f} 0 1 0"
    return {
        "o": f"m{-r:.2f} 0{arc} {2 * r:.2f} 0{arc} {-2 * r:.2f} 0",
        "s": f"m{-r:.2f} {-r:.2f}h{2 * r:.2f}v{2 * r:.2f}h{-2 * r:.2f}z",
        "D": f"m0 {-r:.2f}l{r:.2f} {r:.2f}l{-r:.2f} {r:.2f}l{-r:.2f} {-r:.2f}z",
        "^": f"m0 {-r:.2f}l{r:.2f} {r + t:.2f}h{-2 * r:.2f}z",
        "v": f"m0 {r:.2f}l{r:.2f} {-r - t:.2f}h{-2 * r:.2f}z",
        "x": f"m{-t:.2f} {-t:.2f}l{2 * t:.2f} {2 * t:.2f}m0 {-2 * t:.2f}l{-2 * t:.2f} {2 * t:.2f}",
        "_": f"m{-r:.2f} 0h{2 * r:.2f}",
    }[marker]


def _joined(x: FloatArray, y: FloatArray) -> str:
    """A path through the points, with gaps where one is not finite."""
    known = np.isfinite(x) & np.isfinite(y)
    starts = known & ~np.concatenate([[False], known[:-1]])
    return "".join(
        f"{'M' if start else 'L'}{a:.1f} {b:.1f}"
        for a, b, start in zip(x[known], y[known], starts[known], strict=True)
    )


@dataclass(frozen=True)
class Series:
    """Points joined by a line, marked, or both.

    Attributes
    ----------
    x, y:
        (N,) data; infinite ones lie on the box's edge and do not move the limits.
    color, marker, linestyle, linewidth, markersize, fillstyle, alpha:
        As in Matplotlib; an empty marker or line style draws none.
    label:
        Its name in the legend; empty for none.
    """

    x: FloatArray
    y: FloatArray
    color: str
    marker: str = ""
    linestyle: str = "-"
    linewidth: float = 1.4
    markersize: float = 4.0
    fillstyle: Literal["full", "none"] = "full"
    alpha: float = 1.0
    label: str = ""
    zorder: float = 2.0

    def reach(self) -> tuple[FloatArray, FloatArray]:
        """The points."""
        return self.x, self.y

    def svg(self, place: Place) -> str:
        """One path for the line and one for all markers."""
        x, y = place.at(self.x, self.y)
        return self._line(_joined(x, y)) + self._markers(x, y)

    def symbol(self, x: float, y: float, width: float) -> str:
        """What stands for it in a legend, from (x, y) to the right."""
        middle = np.array([x + width / 2])
        line = self._line(f"M{x:.1f} {y:.1f}h{width:.1f}")
        return line + self._markers(middle, np.array([y]))

    def _line(self, path: str) -> str:
        if not self.linestyle or not path:
            return ""
        dashes = _DASHES[self.linestyle]
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        return (
            f'<path d="{path}" fill="none" stroke="{self.color}"'
            f' stroke-width="{self.linewidth:g}"{dashed}{self._opacity()}/>'
        )

    def _markers(self, x: FloatArray, y: FloatArray) -> str:
        known = np.isfinite(x) & np.isfinite(y)
        if not self.marker or not known.any():
            return ""
        shape = marker_path(self.marker, self.markersize)
        path = "".join(f"M{a:.1f} {b:.1f}{shape}" for a, b in zip(x[known], y[known], strict=True))
        hollow = self.fillstyle == "none" or self.marker in _STROKES
        inside = "none" if hollow else self.color
        return f'<path d="{path}" fill="{inside}" stroke="{self.color}"{self._opacity()}/>'

    def _opacity(self) -> str:
        return "" if self.alpha == 1.0 else f' opacity="{self.alpha:g}"'


@dataclass(frozen=True)
class Tiles:
    """Rectangles of one colour each: bars, a shaded span, the cells of a map.

    Attributes
    ----------
    left, right, low, high:
        (N,) edges in data coordinates; infinite ones lie on the box's edge.
    colors:
        One for each; empty: not drawn.
    edge:
        Colour of the outline; empty for none.
    """

    left: FloatArray
    right: FloatArray
    low: FloatArray
    high: FloatArray
    colors: Sequence[str]
    edge: str = ""
    zorder: float = 1.0

    def reach(self) -> tuple[FloatArray, FloatArray]:
        """Both ends of each."""
        return np.concatenate([self.left, self.right]), np.concatenate([self.low, self.high])

    def svg(self, place: Place) -> str:
        """One rectangle each."""
        left, top = place.at(self.left, self.high)
        right, bottom = place.at(self.right, self.low)
        corners = np.stack([np.minimum(left, right), np.minimum(top, bottom),
                            np.abs(right - left), np.abs(bottom - top)], axis=1)  # fmt: skip
        edge = f' stroke="{self.edge}"' if self.edge else ' shape-rendering="crispEdges"'
        return f"<g{edge}>" + "".join(
            f'<rect x="{x:.2f}" y="{y:.2f}" width="{w:.2f}" height="{h:.2f}" fill="{color}"/>'
            for (x, y, w, h), color in zip(corners.tolist(), self.colors, strict=True)
            if color
        ) + "</g>"  # fmt: skip


@dataclass(frozen=True)
class Squares:
    """Squares of a fixed size on the page, each of its own colour."""

    x: FloatArray
    y: FloatArray
    colors: Sequence[str]
    size: float
    zorder: float = 1.0

    def reach(self) -> tuple[FloatArray, FloatArray]:
        """The middles."""
        return self.x, self.y

    def svg(self, place: Place) -> str:
        """One rectangle each."""
        x, y = place.at(self.x, self.y)
        half = self.size / 2
        return "".join(
            f'<rect x="{a - half:.1f}" y="{b - half:.1f}" width="{self.size:.1f}"'
            f' height="{self.size:.1f}" fill="{color}"/>'
            for a, b, color in zip(x, y, self.colors, strict=True)
            if color
        )


@dataclass(frozen=True)
class Arrows:
    """Arrows at points of the data; one `unit` long is `length` long on the axis of x.

    Attributes
    ----------
    x, y, dx, dy:
        (N,) data.
    colors:
        One for each.
    unit, length:
        The arrows' scale: so much of (dx, dy) is drawn as long as that much of x.
    """

    x: FloatArray
    y: FloatArray
    dx: FloatArray
    dy: FloatArray
    colors: Sequence[str]
    unit: float
    length: float
    width: float = 1.3
    zorder: float = 3.0

    def reach(self) -> tuple[FloatArray, FloatArray]:
        """Where they start."""
        return self.x, self.y

    def svg(self, place: Place) -> str:
        """One filled outline each, those of one colour in one path."""
        x, y = place.at(self.x, self.y)
        grow = self.length / self.unit
        ends = place.at(self.x + grow * self.dx, self.y + grow * self.dy)
        paths: dict[str, list[str]] = {}
        for a, b, c, d, color in zip(x, y, *ends, self.colors, strict=True):
            if np.isfinite(a + b + c + d):
                paths.setdefault(color, []).append(self.outline(a, b, c, d))
        return "".join(f'<path d="{"".join(p)}" fill="{c}"/>' for c, p in paths.items())

    def outline(self, x: float, y: float, to_x: float, to_y: float) -> str:
        """An arrow between two places of the page."""
        long = float(np.hypot(to_x - x, to_y - y))
        if long < 0.2:
            return f"M{x:.1f} {y:.1f}" + marker_path("o", self.width)
        along = np.array([to_x - x, to_y - y]) / long
        aside = np.array([-along[1], along[0]])
        head = min(4.5 * self.width, long)
        neck = long - 0.9 * head
        wide = 0.3 * head
        half = min(0.5 * self.width, wide)
        shape = ((0.0, half), (neck, half), (long - head, wide), (long, 0.0),
                 (long - head, -wide), (neck, -half), (0.0, -half))  # fmt: skip
        points = [(x, y) + a * along + b * aside for a, b in shape]
        return "M" + "L".join(f"{px:.1f} {py:.1f}" for px, py in points) + "z"


@dataclass(frozen=True)
class TextMark:
    """Words at a point of the data, moved by an offset on the page."""

    x: float
    y: float
    text: str
    right: float = 0.0
    up: float = 0.0
    size: float = 8.0
    anchor: Literal["start", "middle", "end"] = "start"
    color: str = "#000000"
    zorder: float = 4.0

    def reach(self) -> tuple[FloatArray, FloatArray]:
        """Nowhere: words do not move the limits."""
        return _NOTHING, _NOTHING

    def svg(self, place: Place) -> str:
        """The words."""
        x, y = place.at(self.x, self.y)
        at = float(x) + self.right, float(y) - self.up
        return text_at(*at, self.text, size=self.size, anchor=self.anchor, color=self.color)
