"""The registers through which a client and the script that it uploaded talk."""

from __future__ import annotations

import re
from collections.abc import Iterable, MutableMapping


class ScriptRegisters:
    """The registers of one script.

    Parameters
    ----------
    registers:
        All of the controller's, by their RTDE names.
    source:
        The script's text, which says at which number its registers begin.
    """

    def __init__(self, registers: MutableMapping[str, int | float], source: str) -> None:
        self._registers = registers
        # the client puts the number behind the comment that marks its place
        offset = re.search(r"# int register offset\s+(\d+)", source)
        self._offset = int(offset.group(1)) if offset else 0

    def in_int(self, index: int) -> int:
        """An integer from the client."""
        return int(self._registers.get(f"input_int_register_{index + self._offset}", 0))

    def in_doubles(self, first: int, count: int = 6) -> tuple[float, ...]:
        """Numbers from the client."""
        start = first + self._offset
        names = (f"input_double_register_{index}" for index in range(start, start + count))
        return tuple(float(self._registers.get(name, 0.0)) for name in names)

    def out(self, index: int) -> int:
        """An integer that the script wrote."""
        return int(self._registers[f"output_int_register_{index + self._offset}"])

    def set_out(self, index: int, value: int) -> None:
        """Write an integer."""
        self._registers[f"output_int_register_{index + self._offset}"] = value

    def set_out_doubles(self, values: Iterable[float]) -> None:
        """Write numbers, from the first register on."""
        for index, value in enumerate(values, self._offset):
            self._registers[f"output_double_register_{index}"] = value
