"""How a result shows itself in a notebook or an interpreter: some lines, a table, a figure.

A result holds arrays of every frame and corner; printed whole it fills a screen a hundred times.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Row = dict[str, float | str | None]


class Shown(ABC):
    """A result that answers with a few lines."""

    @abstractmethod
    def headline(self) -> tuple[str, ...]:
        """What matters, a line each."""

    @abstractmethod
    def rows(self) -> list[Row]:
        """The numbers as rows, such as `pandas.DataFrame(found.rows())` takes."""

    def __repr__(self) -> str:
        return "\n".join(self.headline())

    def _repr_html_(self) -> str:
        first, *others = (escape(line) for line in self.headline())
        lines = "".join(f"<br>{line}" for line in others)
        return f"<p><strong>{first}</strong>{lines}</p>{_table(self.rows())}"


def axes_of(columns: int) -> tuple[Figure, list[Axes]]:
    """A figure with axes side by side.

    Raises
    ------
    ImportError
        Matplotlib is not installed: nothing else here needs it.
    """
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError(
            "plot() needs Matplotlib, which nothing else here does: pip install matplotlib"
        ) from None
    figure, axes = pyplot.subplots(1, columns, figsize=(5 * columns, 4), squeeze=False)
    return figure, list(axes[0])


def _table(rows: list[Row]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{escape(name)}</th>" for name in rows[0])
    body = "".join(
        "<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row.values()) + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _cell(value: float | str | None) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else escape(str(value))
