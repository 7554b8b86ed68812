"""Values out of YAML or JSON: finite, not too many, not too deep, and no knot of aliases."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from typing import Any, NoReturn

from cell.errors import InputError
from cell.storage.incoming.limits import MAGNITUDE, NESTING, VALUES

Location = tuple[int | str, ...]
Where = Callable[[Location], str]


def check_values(data: Any, where: str | Where, *, finite: bool = True) -> None:
    """Refuse values that nothing of ours can work with.

    Parameters
    ----------
    data:
        Mappings, lists and scalars, in which the same list may stand in several places.
    where:
        The file, or what makes the place out of a location in it.
    finite:
        Whether numbers must be; where not, whoever uses them judges.

    Raises
    ------
    InputError
        A number is not finite or too large, a text holds a NUL, a key is a list or a mapping, lists
        are nested too deeply or in themselves, or there are too many values.
    """
    _Checked(where, finite=finite).check(data, ())


class _Checked:
    """One pass over a file's values; what stands in several places is looked at once."""

    def __init__(self, where: str | Where, *, finite: bool) -> None:
        self._where = where
        self._fault = _scalar_fault if finite else _text_fault
        self._sizes: dict[int, int] = {}

    def check(self, data: Any, location: Location) -> int:
        """Check values; returns how many they are, repeated ones counted every time."""
        fault = self._fault(data)
        if fault:
            self._refuse(location, fault)
        if not isinstance(data, _CONTAINERS) or isinstance(data, _TEXTS):
            return 1
        known = self._sizes.get(id(data))
        return self._size(data, location) if known is None else known

    def _size(self, data: Any, location: Location) -> int:
        if len(location) >= NESTING:  # also where a list stands in itself
            self._refuse(location[:8], f"is nested more than {NESTING} deep, or in itself")
        size = 1
        for part, item in _items(data):
            if not isinstance(part, int | str | float | bool | None):
                self._refuse(location, f"has a {type(part).__name__} for a key; keys are words")
            size += self.check(item, (*location, part if isinstance(part, int) else str(part)))
        if size > VALUES:
            self._refuse(location, f"has more than {VALUES} values, aliases counted")
        self._sizes[id(data)] = size
        return size

    def _refuse(self, location: Location, fault: str) -> NoReturn:
        if callable(self._where):
            raise InputError(f"{self._where(location)}: {fault}")
        name = ".".join(str(part) for part in location)
        raise InputError(f"{self._where}: {name}: {fault}" if name else f"{self._where}: {fault}")


_TEXTS = (str, bytes)
_CONTAINERS = (Mapping, Sequence, Set)


def _items(data: Any) -> Iterator[tuple[Any, Any]]:
    if isinstance(data, Mapping):
        yield from data.items()
    else:
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
    return _text_fault(value)


def _text_fault(value: Any) -> str | None:
    return "holds a NUL character" if isinstance(value, str) and "\0" in value else None
