"""Standard streams that are there and never raise: closed at start, a full device, a pipe cut off.

What a verb did is in its files; that nobody listens any more does not undo it.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import Any, TextIO

from cell.errors import InputError

_OUTPUTS = ("stdout", "stderr")


class PatientOutput(io.RawIOBase):
    """A file descriptor that swallows what cannot be written, and remembers why.

    Attributes
    ----------
    fault:
        The first error of writing, or None.
    """

    def __init__(self, descriptor: int) -> None:
        self.fault: OSError | None = None
        self._descriptor = descriptor

    def writable(self) -> bool:
        """Always."""
        return True

    def fileno(self) -> int:
        """The descriptor."""
        return self._descriptor

    def isatty(self) -> bool:
        """Whether a terminal is behind it."""
        return os.isatty(self._descriptor)

    def write(self, data: Any) -> int:
        """Write what can be written; the rest counts as written."""
        left = memoryview(data)
        while left and self.fault is None:
            try:
                left = left[os.write(self._descriptor, left) :]
            except OSError as fault:
                self.fault = fault
        return len(data)


def make_patient() -> None:
    """Open the standard streams that are closed, and let no output raise; call it first of all.

    A descriptor that is closed would be the next file's, and what is printed would go into it.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            mode = os.O_RDONLY if descriptor == 0 else os.O_WRONLY
            os.dup2(os.open(os.devnull, mode), descriptor)
    if sys.stdin is None:
        sys.stdin = open(0, closefd=False)  # noqa: SIM115
    for descriptor, name in enumerate(_OUTPUTS, 1):
        stream = getattr(sys, name)
        if stream is None or stream is getattr(sys, f"__{name}__"):
            setattr(sys, name, _patient(descriptor, stream))


def _patient(descriptor: int, stream: TextIO | None) -> TextIO:
    encoding = getattr(stream, "encoding", None) or "utf-8"
    buffered = io.BufferedWriter(PatientOutput(descriptor))
    return io.TextIOWrapper(
        buffered, encoding, "backslashreplace", line_buffering=True, write_through=descriptor == 2
    )


def lost_output() -> str:
    """Why standard output was not all written, or nothing; who closed a pipe knows it himself."""
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    sys.stdout.flush()
    fault = raw.fault if isinstance(raw, PatientOutput) else None
    if fault is None or fault.errno == errno.EPIPE:
        return ""
    return fault.strerror or str(fault)


def check_output_written() -> None:
    """Raise `InputError` where a result that stands nowhere else was not printed."""
    reason = lost_output()
    if reason:
        raise InputError(f"standard output does not take the result ({reason}); give -o FILE")
