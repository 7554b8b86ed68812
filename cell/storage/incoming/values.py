"""Values out of YAML or JSON: finite, not too many, not too deep, and no knot of aliases."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from typing import Any

from cell.errors import InputError
from cell.storage.incoming.limits import MAGNITUDE, NESTING, VALUES

Location = tuple[int | str, ...]
Where = Callable[[Location], str]


def check_values(data: Any, where: str | Where) -> None:
    """Refuse values that nothing of ours can work with.

    Parameters
    ----------
    data:
        Mappings, lists and scalars, in which the same list may stand in several places.
    where:
        The file, or what makes the place out of a location in it.

    Raises
    ------
    InputError
        A number is not finite or too large, a text holds a NUL, a key is a list or a mapping, lists
        are nested too deeply or in themselves, or there are too many values.
    """
    _Walk(where).check(data, ())


class _Walk:
    """One walk over a file's values."""

    def __init__(self, where: str | Where) -> None:
        self._where = where
        self._left = VALUES

    def check(self, data: Any, location: Location) -> None:
        self._left -= 1
        if self._left < 0:
            self._refuse(location, f"the file has more than {VALUES} values, aliases counted")
        if len(location) > NESTING:
            self._refuse(location[:8], f"is nested more than {NESTING} deep, or in itself")
        fault = _scalar_fault(data)
        if fault:
            self._refuse(location, fault)
        for part, item in _items(data):
            if not isinstance(part, int | str | float | bool | None):
                self._refuse(location, f"has a {type(part).__name__} for a key; keys are words")
            self.check(item, (*location, part if isinstance(part, int) else str(part)))

    def _refuse(self, location: Location, fault: str) -> None:
        if callable(self._where):
            raise InputError(f"{self._where(location)}: {fault}")
        name = ".".join(str(part) for part in location)
        raise InputError(f"{self._where}: {name}: {fault}" if name else f"{self._where}: {fault}")


def _items(data: Any) -> Iterator[tuple[Any, Any]]:
    if isinstance(data, Mapping):
        yield from data.items()
    elif isinstance(data, Set) or (
        isinstance(data, Sequence) and not isinstance(data, str | bytes)
    ):
        yield from enumerate(data)


def _scalar_fault(value: Any) -> str | None:
    """Why a number or a text cannot be used, or None."""
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float):
        if isinstance(value, float) and not math.isfinite(value):
            return f"must be a finite number; write null for an unknown one (got {value})"
        if abs(value) > MAGNITUDE:
            return f"is larger than {MAGNITUDE:g}, which is no measure of anything here"
    if isinstance(value, str) and "\0" in value:
        return "holds a NUL character"
    return None
