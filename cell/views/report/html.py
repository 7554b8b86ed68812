"""The few pieces of HTML every section is made of; text is escaped here and nowhere else."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def text(content: object) -> str:
    """`content` as HTML text."""
    return escape(str(content))


def paragraph(content: str, css: str = "") -> str:
    """A paragraph of plain text."""
    return f"<p{_class(css)}>{text(content)}</p>"


def missing(content: str) -> str:
    """What is not shown, and why."""
    return paragraph(content, "missing")


def bullets(items: Iterable[str]) -> str:
    """A list of plain texts, or nothing."""
    rows = "".join(f"<li>{text(item)}</li>" for item in items)
    return f"<ul>{rows}</ul>" if rows else ""


def section(anchor: str, title: str, *parts: str) -> str:
    """A section of the page with its heading."""
    return f'<section id="{text(anchor)}"><h2>{text(title)}</h2>{"".join(parts)}</section>'


def figure(svg: str, caption: str) -> str:
    """A drawing with its caption."""
    return f"<figure>{svg}<figcaption>{text(caption)}</figcaption></figure>"


def table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """A table whose first column names the row; it scrolls by itself on a narrow screen."""
    top = "".join(f'<th scope="col">{text(cell)}</th>' for cell in head)
    body = "".join(_row(row) for row in rows)
    title = f"<caption>{text(caption)}</caption>" if caption else ""
    return (
        f'<div class="scroll"><table>{title}<thead><tr>{top}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def fold(title: str, content: str) -> str:
    """Content the reader opens when wanted."""
    return f"<details><summary>{text(title)}</summary>{content}</details>"


def card(title: str, value: str, note: str, css: str = "") -> str:
    """One of the answers at the top."""
    return (
        f'<div class="card {text(css)}"><h3>{text(title)}</h3>'
        f'<p class="value">{text(value)}</p><p class="note">{text(note)}</p></div>'
    )


def _row(cells: Sequence[object]) -> str:
    first, *rest = cells
    others = "".join(f"<td>{text(cell)}</td>" for cell in rest)
    return f'<tr><th scope="row">{text(first)}</th>{others}</tr>'


def _class(css: str) -> str:
    return f' class="{text(css)}"' if css else ""
