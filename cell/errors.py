"""What the operator's side may raise; devices raise `drivers.errors`.

::

    CellError                   carries the exit status of the contract
    ├── InputError              unusable input or arguments                      2
    ├── BadAnswer               the work was done and its answer is bad          1
    ├── DiskFailed              the disk does not take what was recorded         3
    └── StoppedByOperator       Ctrl-C, a signal, or the Stop button             4

Every message says what is wrong, where (file, line, key, frame) and what to do.
"""

from __future__ import annotations

from drivers.errors import DeviceError, SafetyError

EXIT_DONE = 0
EXIT_BAD_ANSWER = 1
EXIT_INPUT = 2
EXIT_DEVICE = 3
EXIT_OPERATOR = 4
EXIT_SAFETY = 5


class CellError(Exception):
    """Anything the operator gets as a message, never as a traceback."""

    exit_status = EXIT_BAD_ANSWER


class InputError(CellError):
    """Unusable input or arguments."""

    exit_status = EXIT_INPUT


class BadAnswer(CellError):
    """The work was done and its answer is bad: frames lost, no calibration possible."""


class DiskFailed(CellError):
    """The disk does not take what was recorded: full, read-only, broken."""

    exit_status = EXIT_DEVICE


class StoppedByOperator(CellError):
    """The operator asked to stop; the arm was stopped first."""

    exit_status = EXIT_OPERATOR


def exit_status_of(error: BaseException) -> int | None:
    """The contract's exit status of an error, or None for one nobody foresaw."""
    if isinstance(error, CellError):
        return error.exit_status
    if isinstance(error, SafetyError):
        return EXIT_SAFETY
    if isinstance(error, DeviceError):
        return EXIT_DEVICE
    return None
