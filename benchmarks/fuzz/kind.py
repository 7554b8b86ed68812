"""What a kind of input is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cell.errors import CellError
from drivers.errors import DeviceError, SafetyError

REFUSED = (CellError, SafetyError, DeviceError)


@dataclass(frozen=True)
class Kind:
    """One kind of input.

    Attributes
    ----------
    name, examples, slow:
        What it is called; valid ones; whether a reader for people's files reads it.
    read:
        Reads an input, in a folder of its own; raises what is in `refused` for a bad one.
    """

    name: str
    examples: tuple[bytes, ...]
    read: Callable[[Path, bytes], object]
    refused: tuple[type[Exception], ...] = REFUSED
    slow: bool = False
