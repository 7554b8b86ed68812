"""`--page [HOST:PORT]`: an option whose value may be left out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from typer.core import TyperCommand

from cell.views.page.address import DEFAULT, is_address

NAME = "--page"


class WithPage(TyperCommand):
    """A command whose `--page` takes the next word only where that is an address."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Give a bare `--page` its default address."""
        return super().parse_args(ctx, list(with_addresses(args)))


def with_addresses(arguments: list[str]) -> Iterator[str]:
    """The words with an address behind every `--page`: the one that follows, or the default."""
    left = iter(arguments)
    for word in left:
        if word != NAME:
            yield word
            continue
        following = next(left, None)
        if following is not None and is_address(following):
            yield f"{NAME}={following}"
        else:
            yield f"{NAME}={DEFAULT}"
            yield from () if following is None else with_addresses([following, *left])
